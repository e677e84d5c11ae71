"""What there is to choose from, by name: the tables of a scenario that have a kind, and the shipped
scenarios. Nothing heavy is imported to look.
"""

from __future__ import annotations

from importlib import resources

PLUGINS = {
    "robot": ("sim.robots", "gantry"),
    "motion": ("sim.motions", "still"),
    "tracker": ("tracking.trackers", "pf_ssd"),
    "estimator": ("servo.estimators", "kalman_cv"),
    "controller": ("servo.controllers", "ibvs"),
}
"""Tables with a `kind`: the folder it is looked up in, and the kind where none is given."""
LISTS = {"disturbances": "sim.disturbances"}


def shipped() -> list[str]:
    """Names of the scenarios in the package, sorted."""
    files = resources.files("scenes").iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))
