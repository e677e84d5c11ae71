"""What there is to choose from, by name: the tables of a scenario that have a kind, and the shipped
scenarios. Nothing heavy is imported to look.
"""

from __future__ import annotations

from importlib import resources
from importlib.resources.abc import Traversable

from servo import controllers, estimators, features
from sim import disturbances, motions, robots, targets
from tracking import trackers

PLUGINS = {
    "robot": (robots.KINDS, "gantry"),
    "target": (targets.KINDS, "car"),
    "motion": (motions.KINDS, "still"),
    "tracker": (trackers.KINDS, "pf_ssd"),
    "features": (features.KINDS, "moments"),
    "estimator": (estimators.KINDS, "kalman_cv"),
    "controller": (controllers.KINDS, "ibvs"),
}
"""Tables with a `kind`: the kinds that there are, and the one where none is given."""
LISTS = {"disturbances": disturbances.KINDS}
"""Lists of such tables."""


def shipped() -> list[str]:
    """Names of the scenarios in the package, sorted."""
    return _names(resources.files("scenes"))


def studies() -> list[str]:
    """Names of the studies in the package, sorted."""
    return _names(resources.files("scenes") / "studies")


def sentence(text: str) -> str:
    """A scenario's or a study's second line, a comment that says what it shows; or nothing.

    Directives to editors, "#:schema ...", are no lines of its own.
    """
    lines = [line for line in text.splitlines() if not line.startswith("#:")]
    second = [*lines, "", ""][1]
    return second.removeprefix("# ") if second.startswith("# ") else ""


def _names(folder: Traversable) -> list[str]:
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )
