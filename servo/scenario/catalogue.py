"""The choices by name: kinds of a scenario's parts, shipped scenarios and studies.

This file is quick to import, for `servobench list`.
"""

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
"""Tables with a `kind`: their kinds, and the default."""
LISTS = {"disturbances": disturbances.KINDS}
"""Lists of such tables."""


def shipped() -> list[str]:
    """Return the names of the scenarios in the package, sorted."""
    return _names(resources.files("scenes"))


def studies() -> list[str]:
    """Return the names of the studies in the package, sorted."""
    return _names(resources.files("scenes") / "studies")


def sentence(text: str) -> str:
    """Return the comment in the second line of a scenario or a study, or an empty text.

    Directives to editors, "#:schema ...", do not count as lines.
    """
    lines = [line for line in text.splitlines() if not line.startswith("#:")]
    second = [*lines, "", ""][1]
    return second.removeprefix("# ") if second.startswith("# ") else ""


def _names(folder: Traversable) -> list[str]:
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )
