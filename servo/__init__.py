"""Visual servoing in closed loop: scenarios, features, estimators, control laws, runs, studies,
their reports, benchmarks, and the command line.

All names for users (`servo.__all__`) can be imported from `servo`; the module that defines a name
is loaded when the name is first used::

    import servo

    errors = [step.servo_error for step in servo.run(servo.load("circle", seed=3))]
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from servo.loop.episode import Episode, run
    from servo.loop.loop import Loop, Running
    from servo.loop.step import Step
    from servo.mistake import Mistake
    from servo.parts import Controller, Estimator, FeatureSet, Task
    from servo.result import Run, Sweep, simulate, sweep
    from servo.scenario.load import Scenario, load
    from servo.study.run import Record
    from servo.types import Command, Sight
    from sim.channels import Channel, View
    from sim.ranges import File
    from sim.types import Camera, Frame, Pose, Posture
    from tracking import create
    from tracking.types import Estimate, Region, State, Status, Tracker

    __version__: str

__all__ = [
    "Camera",
    "Channel",
    "Command",
    "Controller",
    "Episode",
    "Estimate",
    "Estimator",
    "FeatureSet",
    "File",
    "Frame",
    "Loop",
    "Mistake",
    "Pose",
    "Posture",
    "Record",
    "Region",
    "Run",
    "Running",
    "Scenario",
    "Sight",
    "State",
    "Status",
    "Step",
    "Sweep",
    "Task",
    "Tracker",
    "View",
    "__version__",
    "create",
    "load",
    "run",
    "simulate",
    "sweep",
]
HOMES = {
    "servo.loop.episode": ("Episode", "run"),
    "servo.loop.loop": ("Loop", "Running"),
    "servo.loop.step": ("Step",),
    "servo.mistake": ("Mistake",),
    "servo.scenario.load": ("Scenario", "load"),
    "servo.parts": ("Controller", "Estimator", "FeatureSet", "Task"),
    "servo.result": ("Run", "Sweep", "simulate", "sweep"),
    "servo.study.run": ("Record",),
    "servo.types": ("Command", "Sight"),
    "sim.channels": ("Channel", "View"),
    "sim.ranges": ("File",),
    "sim.types": ("Camera", "Frame", "Pose", "Posture"),
    "tracking": ("create",),
    "tracking.types": ("Estimate", "Region", "State", "Status", "Tracker"),
}
"""The public names, by the module that they are imported from."""
PACKAGES = ("scenes", "sim", "tracking")
"""The packages that are installed beside this one."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("servobench")
    for home, names in HOMES.items():
        if name in names:
            return getattr(import_module(home), name)
    raise AttributeError(f"module 'servo' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__


def _check_packages() -> None:
    """Check that Python imports the packages of servobench, and not a file or folder of the same
    name in the user's folder.

    Raises:
        ImportError: A file or folder hides a package; the message names it. The command prints this
            message and ends with exit code 2.
    """
    beside = Path(__file__).resolve().parents[1]
    for name in PACKAGES:
        spec = find_spec(name)
        if spec is None:
            continue
        place = Path(spec.origin or next(iter(spec.submodule_search_locations or [name])))
        found = place.parent if place.stem == "__init__" else place
        if found.resolve() != beside / name:
            _refuse(found, name)


def _refuse(found: Path, name: str) -> None:
    from servo.mistake import Mistake

    what = "folder" if found.is_dir() else "file"
    error = Mistake(f"{found} hides servobench's package '{name}': rename this {what}")
    program = next(iter(sys.argv), "")  # "-m" while Python looks for a module to run
    is_module = program == "-m" and not {"servo", "-mservo"}.isdisjoint(sys.orig_argv)
    if not is_module and Path(program).stem != "servobench":
        raise ImportError(str(error), name=name, path=str(found))
    if sys.stderr is not None:
        sys.stderr.write(f"servobench: {error}\n")
    sys.exit(2)


_check_packages()
