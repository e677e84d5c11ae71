"""The shipped kinds of each component of a scenario (robot, tracker, ...), the names of the shipped
scenarios and studies, and the sentence with which such a file describes itself.

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
"""Tables of a scenario with a `kind`: the kinds there are, and the default."""
LISTS = {"disturbances": disturbances.KINDS}
"""Lists of tables with a `kind`: the kinds there are."""


def shipped() -> list[str]:
    """Return the names, such as "reversal", of the scenarios that are part of servobench, in
    alphabetical order.
    """
    return _names(resources.files("scenes"))


def studies() -> list[str]:
    """Return the names of the studies that are part of servobench, in alphabetical order."""
    return _names(resources.files("scenes") / "studies")


def sentence(text: str) -> str:
    """Return the sentence that says what a scenario or study is for: the comment in the second line
    of its file, without "# ". Lines such as "#:schema ..." do not count as lines. The result is ""
    if the second line is no comment.

    Args:
        text: The whole text of the file.
    """
    lines = [line for line in text.splitlines() if not line.startswith("#:")]
    second = [*lines, "", ""][1]
    return second.removeprefix("# ") if second.startswith("# ") else ""


def _names(folder: Traversable) -> list[str]:
    """Return the sorted names, without ending, of the TOML files in a folder."""
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )
