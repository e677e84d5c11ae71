"""The contestants of a benchmark: the trackers or control laws that come with servobench, and those
of a user: a class, a command, or files of networks.
"""

import hashlib
import json
import os
import shlex
import shutil
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from importlib.machinery import PathFinder
from pathlib import Path

from servo.bench.benchmark import Band, Benchmark, Settings
from servo.controllers import KINDS as LAWS
from servo.features import KINDS as FEATURES
from servo.mistake import Mistake, check_rules
from servo.scenario.part_names import ONNX, PROGRAM, TRAX, named_part, settings_of
from servo.scenario.toml import assignment
from sim.channels import Channel
from sim.files.behind import files_behind
from tracking.files.json_text import as_json
from tracking.trackers import KINDS as TRACKERS
from tracking.trackers import general_kinds
from tracking.types import follows_any_target

NULL = "still"
PERFECT = "truth"
"""Names of the contestants that fix the scale."""
FROZEN = "frozen"
"""A shipped tracker that does not use pictures: the worlds that it holds prove nothing."""
OURS = ("scenes", "servo", "sim", "tracking")
"""Packages of servobench, which do not belong to a contestant: a row names their version."""
COMMANDS = ("tracker.command", "controller.command")
NAMING = (*COMMANDS, "tracker.model", "controller.file")
"""Settings that name the files of a user's contestant."""
SERVERS = {"tracker": "tracking.exported.program_server", "controller": "servo.policy_server"}
"""Modules that run a user's class in a process of its own, by the section of a scenario."""
SCRIPTS = (".py", ".sh")
"""Files of a command that may use the modules beside them."""
CHANGEABLE = {
    "tracker": ("tracker", "features", "controller"),
    "law": ("features", "controller"),
    "pictures": ("features", "controller"),
}
"""Sections of a scenario whose settings a contestant of the division OPEN may change."""
OF_CONTROLLERS: Settings = {"features.kind": "points"}
"""Features of a controller that is given alone: they determine all six degrees of freedom."""


class Division(Enum):
    """The way in which a contestant was run: HOME (shipped with servobench), CLOSED (a user's
    tracker or policy, of which the settings of all other components are the benchmark's), OPEN (a
    user's class in the simulation's process, or changed settings) or SCALE (a reference that fixes
    0 or 100). Each member's value describes it in words.
    """

    HOME = (
        "shipped with servobench, and run in the process of the simulation; its settings are part "
        "of the benchmark's history"
    )
    CLOSED = (
        "a tracker or policy in another process (or a network as policy), which gets pictures (a "
        "policy also the robot's posture) and nothing else; all other settings are those of the "
        "file"
    )
    OPEN = "in the same process as the simulation, or with other settings than the file's"
    SCALE = "fixes 0 or 100 on the scale"


@dataclass(frozen=True, slots=True)
class Contestant:
    """A tracker or control law that takes part in a benchmark: its name in the table of results,
    the scenario's settings that it changes, by dotted key, and the way in which it is run
    (`division`).
    """

    name: str
    settings: Settings
    division: Division

    @property
    def digest(self) -> str:
        """SHA-256 digest, 64 hexadecimal digits, of the contestant's settings and, for a user's
        contestant, of the code and the files that its settings name.
        """
        found = hashlib.sha256(json.dumps(as_json(self.settings), sort_keys=True).encode())
        for name, content in sorted((path.name, path.read_bytes()) for path in self._files()):
            found.update(name.encode() + content)
        return found.hexdigest()

    @property
    def is_unknown(self) -> bool:
        """True if the settings of a user's contestant name code or files, of which none was found,
        so that `digest` does not cover them.
        """
        named = any(key in self.settings for key in NAMING) or any(":" in w for w in self._words())
        return named and not self._files()

    def _words(self) -> Iterator[str]:
        """Yield the texts in the contestant's settings that may name a file or a module, such as
        the words of a command.
        """
        for key, value in self.settings.items():
            if key in COMMANDS:
                yield from shlex.split(str(value))
            else:
                yield from map(str, value if isinstance(value, list) else [value])

    def _files(self) -> set[Path]:
        """Return the files that a user's contestant is made of: those that its settings name, with
        the files that these refer to, the modules beside a script, and those in the package of a
        class or module.
        """
        if self.division in (Division.HOME, Division.SCALE):
            return set()
        found = set[Path]()
        before = ""
        for word in self._words():
            files = _files_in(word)
            for path in files:
                found |= files_behind(path)
                found |= _modules(path.parent) if path.suffix in SCRIPTS else set()
            if not files and (before == "-m" or ":" in word):
                found |= _package(word.partition(":")[0].partition(".")[0])
            before = word
        return {path.resolve() for path in found}


def _files_in(word: str) -> list[Path]:
    """Return the existing files that a word of a command names, such as vit.onnx, model="vit.onnx"
    or model=["a.onnx", "b.onnx"], but not the Python interpreter.
    """
    value = word.partition("=")[2]
    with suppress(ValueError):
        value = json.loads(value)
    named = value if isinstance(value, list) else [value or word]
    paths = [Path(str(each).strip("'")) for each in (word, *named)]
    return [path for path in paths if path.is_file() and path != Path(sys.executable)]


def _package(name: str) -> set[Path]:
    """Return the files of a package's modules. For a single module, return its file and, unless it
    is installed, the Python files in its folder and subfolders. Return nothing if the module is not
    found or belongs to servobench.
    """
    spec = None if name in OURS else PathFinder.find_spec(name, [str(Path.cwd()), *sys.path])
    if spec is None:
        return set()
    if spec.submodule_search_locations is not None:
        return {path for each in spec.submodule_search_locations for path in _modules(Path(each))}
    file = Path(spec.origin or "")
    installed = any(file.is_relative_to(place) for place in (sys.prefix, sys.base_prefix))
    return {file} if installed else {file} | _modules(file.parent)


def _modules(folder: Path) -> set[Path]:
    """Return the Python files in a folder and its subfolders, except in virtual environments,
    hidden subfolders and servobench.
    """
    found = set[Path]()
    for place, folders, files in os.walk(folder):
        found |= {Path(place, name) for name in files if name.endswith(".py")}
        folders[:] = [
            name
            for name in folders
            if name not in OURS
            and not name.startswith(".")
            and not Path(place, name, "pyvenv.cfg").exists()
        ]
    return found


def scale_of(benchmark: Benchmark) -> list[Contestant]:
    """Return the reference contestants, whose results fix the ends of the scale of scores: "still"
    has the score 0; "truth", if the benchmark has it, has 100.
    """
    ends = {NULL: benchmark.null, PERFECT: benchmark.perfect}
    return [Contestant(name, s, Division.SCALE) for name, s in ends.items() if s is not None]


def home_of(benchmark: Benchmark) -> list[Contestant]:
    """Return the contestants of a benchmark that come with servobench: all trackers that can follow
    any target by pictures and the camera's motion alone, or the control laws that the benchmark's
    file lists.
    """
    if benchmark.contestant != "tracker":
        return [Contestant(name, s, Division.HOME) for name, s in benchmark.home.items()]
    own = [k for k in general_kinds() if ":" not in k and not TRACKERS.package_of(k)]
    return [Contestant(kind, {"tracker.kind": kind}, Division.HOME) for kind in own]


def contestants(
    benchmark: Benchmark, given: Sequence[str], changes: Sequence[str] = ()
) -> list[Contestant]:
    """Return the contestants that the command line names.

    Args:
        benchmark: The benchmark in which they take part.
        given: Names of shipped contestants, or name=kind:preset, name=module:Class,
            name='trax:COMMAND' or name='program:COMMAND' for a program, or
            name=onnx:FILE[,FILE[,FILE]] for networks of OpenCV's trackers (for a law, one network
            that acts as controller); empty: all shipped contestants.
        changes: Changes KEY=VALUE of the settings of all contestants, whose division is then OPEN.
            A user's tracker, or policy for goal pictures, runs in another process, unless a setting
            of the tracker or the controller is changed; a user's class in a benchmark of laws runs
            in this process.

    Raises:
        Mistake: There is no such contestant, it uses more than pictures, it does not use the
            picture at the goal where the benchmark requires it, its name, command or file is
            missing, it has too many files, two have one name, or one has that of a reference
            ("still" or "truth"); or a change does not have that form, or is of a setting that no
            contestant may change.
    """
    home = {one.name: one for one in home_of(benchmark)}
    changed = dict(map(assignment, changes))
    chosen = list(home.values())
    if given:
        served = not any(key.startswith(("tracker.", "controller.")) for key in changed)
        chosen = [home.get(text) or _guest(benchmark, home, text, served) for text in given]
    _check_changes(benchmark, changed)
    if changed:
        chosen = [Contestant(c.name, c.settings | changed, Division.OPEN) for c in chosen]
    # After the changes: they could name a tracker that is told the truth.
    for one in chosen:
        if benchmark.contestant == "tracker":
            _check_tracker(one.settings)
        elif benchmark.contestant == "pictures":
            _check_pictures(benchmark, one)
    names = [one.name for one in chosen]
    check_rules(
        *(
            (
                names.count(name) > 1 or name in (NULL, PERFECT),
                f"two contestants are called '{name}': write one of them as NAME=KIND or "
                "NAME=module:Class, with a name that no other has",
            )
            for name in names
        )
    )
    return chosen


def _check_changes(benchmark: Benchmark, changed: Collection[str]) -> None:
    """Check that changed settings, by dotted key, belong to a contestant, and not to the worlds,
    such as the duration of a run.

    Raises:
        Mistake: One does not.
    """
    own = CHANGEABLE[benchmark.contestant]
    *others, last = (f"[{section}]" for section in own)
    check_rules(
        *(
            (
                key.partition(".")[0] not in own,
                f"--set {key}: this setting belongs to the worlds of {benchmark.name}: a "
                f"contestant may change settings of {', '.join(others)} and {last} only",
            )
            for key in changed
        )
    )


def _check_tracker(settings: Settings) -> None:
    """Check that the tracker that a contestant's settings name uses only pictures and the camera's
    motion, and needs no marker. A user's class is not checked: it is not imported here, as it runs
    in a process of its own.

    Raises:
        Mistake: The tracker uses more, such as the truth.
    """
    kind = str(settings["tracker.kind"])
    if kind in TRACKERS.names() and not follows_any_target(TRACKERS.config(kind)):
        raise Mistake(
            f"the tracker '{kind}' cannot take part, because it uses more than pictures: choose "
            "another one"
        )


def _check_pictures(benchmark: Benchmark, one: Contestant) -> None:
    """Check that a contestant's law uses the picture at the goal: other laws are given the target's
    true pose.

    Raises:
        Mistake: It does not, or a setting of the contestant is wrong.
    """
    world = benchmark.every_world(Band(), 1)[0]
    if Channel.GOAL_PICTURE not in benchmark.scenario_of(world, one.settings).needs:
        raise Mistake(
            f"'{one.name}' cannot take part, because it does not use the picture at the goal: give "
            "a policy act(picture, goal_picture, camera, posture), or features made of pixels"
        )


def _served(section: str, settings: Settings) -> Settings:
    """Return settings that run a tracker or policy, given by its settings in a section of a
    scenario, in another Python process, which gets pictures (a policy also the robot's posture)
    only.
    """
    table = {key.removeprefix(f"{section}."): value for key, value in settings.items()}
    python = Path(shutil.which("python") or "")
    words = ["python" if python == Path(sys.executable) else sys.executable]
    words += ["-m", SERVERS[section], str(table.pop("kind"))]
    if preset := table.pop("preset", None):
        words += ["--preset", str(preset)]
    words += [f"{key}={json.dumps(value)}" for key, value in table.items()]
    return settings_of(section, PROGRAM + shlex.join(words))


def _guest(benchmark: Benchmark, home: Collection[str], text: str, served: bool) -> Contestant:
    is_law = benchmark.contestant != "tracker"
    name, what = named_part("controller" if is_law else "tracker", text)
    kinds = [*FEATURES.names(), *LAWS.names()] if is_law else TRACKERS.names()
    if what not in (*home, *kinds) and ":" not in what:
        shipped = ", ".join(f"'{one}'" for one in home)
        raise Mistake(f"there is no contestant '{what}'; shipped are {shipped}")
    if is_law:
        own = benchmark.home.get(what)
        if own is None and what in FEATURES.names():
            own = settings_of("features", what)
        settings = own or OF_CONTROLLERS | settings_of("controller", what)
        division = Division.HOME if what in (*home, *kinds) else Division.OPEN
        if benchmark.contestant == "pictures" and division is Division.OPEN:
            settings, division = _policy(what, served)
        return Contestant(name, settings, division)
    settings = settings_of("tracker", what)
    if what.startswith((TRAX, PROGRAM)):
        return Contestant(name, settings, Division.CLOSED)
    _check_tracker(settings)
    kind = str(settings["tracker.kind"])
    if kind in home:
        return Contestant(name, settings, Division.HOME)
    if served:
        return Contestant(name, _served("tracker", settings), Division.CLOSED)
    return Contestant(name, settings, Division.OPEN)


def _policy(what: str, served: bool) -> tuple[Settings, Division]:
    """Return the settings and the division of a user's policy: a program or a network runs by
    itself; a class or a function, if `served`, in another process.
    """
    settings = settings_of("controller", what)
    if what.startswith((PROGRAM, ONNX)):
        return OF_CONTROLLERS | settings, Division.CLOSED
    if not served:
        return OF_CONTROLLERS | settings, Division.OPEN
    return OF_CONTROLLERS | _served("controller", settings), Division.CLOSED
