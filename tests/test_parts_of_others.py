"""Parts from outside: by entry point, by path, from Python."""

import dataclasses
import json
import sys
from pathlib import Path

import pytest

from servo.cli import doctor_command, list_command, schema_command
from servo.mistake import Mistake
from servo.output.versions import versions
from servo.scenario.load import load, parse
from servo.study.run import Job
from servo.study.scenario_run import StudiedScenario
from sim import kinds
from sim.installed import entries
from tracking import create
from tracking.trackers import KINDS as TRACKERS

MODULE = '''"""A module of somebody."""

from dataclasses import dataclass

from tracking.trackers.frozen import Frozen


@dataclass(frozen=True)
class Config:
    """Stands still.

    It is a joke.
    """

    least: int = 3
    """A number."""

    def build(self, rng):
        return Frozen()


@dataclass(frozen=True)
class Bare:
    size: int

    def build(self, rng):
        return Frozen()


@dataclass(frozen=True)
class Other(Config):
    """Another one."""


@dataclass(frozen=True)
class Odd:
    size: "NotImported" = 3

    def build(self, rng):
        return Frozen()


@dataclass(frozen=True)
class Strange:
    size: Frozen = None

    def build(self, rng):
        return Frozen()


@dataclass(frozen=True)
class Raises:
    def __post_init__(self):
        raise KeyError("no licence")

    def build(self, rng):
        return Frozen()


class Plain:
    def build(self, rng):
        return Frozen()


VALUE = 3
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Makes an installed package with a module and kinds of trackers."""
    monkeypatch.syspath_prepend(tmp_path)
    entries.cache_clear()
    made = []

    def make(name, **kinds_of):
        module = name.replace("-", "_")
        made.append(module)
        (tmp_path / f"{module}.py").write_text(MODULE)
        info = tmp_path / f"{module}-1.5.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
        lines = [f"{kind} = {module}:{of}" for kind, of in kinds_of.items()]
        (info / "entry_points.txt").write_text("\n".join(["[servobench.trackers]", *lines]))
        return module

    yield make
    entries.cache_clear()
    for module in made:  # a test may have imported another text of it than the next one has
        sys.modules.pop(module, None)


def test_a_kind_of_an_installed_package_stands_beside_ours(package):
    package("pkg-a", calm="Config")
    assert "calm" in TRACKERS.names()
    assert TRACKERS.package_of("calm") == "pkg-a 1.5"
    assert TRACKERS.package_of("kams") == ""
    assert TRACKERS.summary("calm") == "Stands still."
    scenario = load("still", ["tracker.kind=calm", "tracker.least=4"])
    assert scenario.settings()["tracker"] == {"kind": "calm", "least": 4}
    assert parse({"tracker": {"kind": "calm"}}, "a", "a.toml").tracker.least == 3
    assert versions()["pkg-a"] == "1.5"
    assert dataclasses.asdict(load("still", ["tracker.kind=pkg-a:calm"]).tracker) == {"least": 3}


def test_the_doctor_names_kinds_that_cannot_be_imported(package):
    package("pkg-a", calm="Config", lame="Nobody")
    assert doctor_command._broken() == [
        "the kind 'lame' of pkg-a 1.5: 'pkg_a:Nobody' cannot be imported: module 'pkg_a' has no "
        "attribute 'Nobody'"
    ]


def test_names_that_two_packages_use_are_written_with_the_package(package):
    package("pkg-a", calm="Config", kams="Other")
    package("pkg-b", calm="Config")
    names = TRACKERS.names()
    assert [n for n in names if "calm" in n or "kams" in n] == [
        "kams",
        "pkg-a:calm",
        "pkg-a:kams",
        "pkg-b:calm",
    ]
    assert kinds.kind_of(load("still", ["tracker.kind=kams"]).tracker) == "kams"
    assert kinds.kind_of(load("still", ["tracker.kind=pkg-a:kams"]).tracker) == "pkg-a:kams"
    with pytest.raises(Mistake) as refused:
        parse({"tracker": {"kind": "calm"}}, "a", "a.toml")
    assert str(refused.value) == (
        "a.toml: tracker.kind: several packages have a kind 'calm': write pkg-a:calm or pkg-b:calm"
    )


@pytest.mark.parametrize(
    ("of", "sentence"),
    [
        ("Bare", "'x': the settings size have no defaults: give each a default"),
        ("Plain", "'x' has a method build(rng), but is no dataclass of settings: make it one"),
        (
            "VALUE",
            "'x' is no Config: a Config is a dataclass with a method build(rng); it also lacks the two "
            "methods init(image, box) and update(image)",
        ),
        (
            "Nope",
            "the kind 'x' of pkg-a 1.5: 'pkg_a:Nope' cannot be imported: module 'pkg_a' has no "
            "attribute 'Nope'",
        ),
    ],
)
def test_a_broken_kind_of_a_package_is_a_sentence(package, of, sentence):
    package("pkg-a", x=of)
    with pytest.raises(Mistake) as refused:
        load("still", ["tracker.kind=x"])
    assert str(refused.value) == f"--set tracker.kind=x: tracker.kind: {sentence}"


def test_a_path_is_taken_from_the_command_line_and_from_python_but_not_from_a_file(package):
    module = package("pkg-a")
    path = f"{module}:Config"
    scenario = load("still", [f"tracker.kind={path}", "tracker.least=9"])
    assert scenario.settings()["tracker"] == {"kind": path, "least": 9}
    assert type(create(path)).__name__ == "Frozen"
    with pytest.raises(Mistake) as refused:
        parse({"tracker": {"kind": path}}, "a", "a.toml")
    assert str(refused.value) == (
        f"a.toml: tracker.kind: '{path}' is no kind of an installed package, and a TOML file "
        "may not name code to import: give the kind with --set, or from Python"
    )


def test_a_setting_may_be_kept_out_of_files(package):
    module = package("pkg-a", calm="Config")
    config = TRACKERS.config_of("calm")
    config.not_from_file = ("least",)
    assert load("still", ["tracker.kind=calm"]).tracker.least == 3
    with pytest.raises(
        Mistake, match=r"a.toml: tracker.least: a TOML file may not name a command to "
    ):
        parse({"tracker": {"kind": "calm", "least": "4"}}, "a", "a.toml")
    assert module


def test_a_class_or_an_instance_from_python(package):
    package("pkg-a", calm="Config")
    config = TRACKERS.config_of("calm")
    assert load("still", tracker=config).tracker == config()
    assert load("still", tracker=config(least=8)).tracker.least == 8
    with pytest.raises(Mistake, match=r"^there is no setting 'tracer'; did you mean 'tracker'\?$"):
        load("still", tracer=config)
    with pytest.raises(Mistake, match=r"^motion: 'object' is no Config: "):
        load("still", motion=object)


def test_a_worker_that_lacks_a_package_is_named():
    base = StudiedScenario("still", {"tracker": {"kind": "calm"}}, "still.toml")
    job = Job(0, base, 0)
    with pytest.raises(Mistake) as failed:
        job.run(Path())
    said = str(failed.value)
    assert said.startswith("the worker on ")
    assert (
        " lacks a package of this study; install it there: still.toml: tracker.kind: there is no kind 'calm'; there is "
        in said
    )


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("Odd", "NameError: name 'NotImported' is not defined"),
        ("Strange", "PydanticSchemaGenerationError: Unable to generate pydantic-core schema for "),
        ("Raises", "KeyError: 'no licence'"),
    ],
)
def test_settings_of_a_type_that_cannot_be_used_end_nothing_else(package, capsys, name, why):
    module = package("mine", odd=name, good="Other")
    sentence = f"the settings of the class {module}:{name} cannot be used; correct the class: {why}"
    kinds_there = {
        schema["properties"]["kind"]["const"]
        for schema in json.loads(schema_command.text())["$defs"].values()
        if "const" in schema.get("properties", {}).get("kind", {})
    }
    assert "good" in kinds_there
    assert "odd" not in kinds_there
    with pytest.raises(kinds.UnknownKind) as shown:
        list_command.show("odd")
    assert sentence in str(shown.value)
    with pytest.raises(Mistake) as found:
        load("still", ["tracker.kind=odd"])
    assert str(found.value).startswith(f"--set tracker.kind=odd: tracker.kind: {sentence}")
    list_command.show_all()
    assert "odd" in capsys.readouterr().out


NAMED = b"Metadata-Version: 2.1\nName: %s\nVersion: %s\n"
COLOURED = b"\x1b[31mred"
ENTRY = b"[servobench.trackers]\nbad = pkg_a:Config\n"


@pytest.mark.parametrize(
    ("listed", "metadata"),
    [
        (b"[console_scripts]\nno equals sign\n", NAMED % (b"bad", b"1")),
        (b"[servobench.trackers]\nbad pkg_a:Config\n", NAMED % (b"bad", b"1")),
        (b"bad = pkg_a:Config\n", NAMED % (b"bad", b"1")),
        (b"[servobench.trackers\nbad = pkg_a:Config\n", NAMED % (b"bad", b"1")),
        (b"[servobench.trackers]\n= pkg_a:Config\n", NAMED % (b"bad", b"1")),
        (b"[servobench.trackers]\nb\xff\xfe = pkg_a:Config\n", NAMED % (b"bad", b"1")),
        (ENTRY.decode().encode("utf-16"), NAMED % (b"bad", b"1")),
        (ENTRY.replace(b"bad", COLOURED), NAMED % (b"bad", b"1")),
        (ENTRY.replace(b"pkg_a", COLOURED), NAMED % (b"bad", b"1")),
        (ENTRY.replace(b"bad", "\u202edab".encode()), NAMED % (b"bad", b"1")),
        (ENTRY, NAMED % (COLOURED, b"1")),
        (ENTRY, NAMED % (b"bad", COLOURED)),
        (ENTRY, b"Name: \xff\xfe\nVersion: 1\n"),
        (ENTRY, b"Name: bad\n"),
        (ENTRY, b""),
    ],
)
def test_a_package_that_cannot_be_read_brings_nothing_and_ends_nothing(
    package, tmp_path, capsys, listed, metadata
):
    package("pkg-a", calm="Config")
    names = TRACKERS.names()
    info = tmp_path / "bad-1.dist-info"
    info.mkdir()
    (info / "entry_points.txt").write_bytes(listed)
    (info / "METADATA").write_bytes(metadata)
    entries.cache_clear()
    assert TRACKERS.names() == names
    assert "calm" in names
    list_command.show("tracker")
    assert "calm" in capsys.readouterr().out


def test_an_extra_of_an_entry_point_is_no_part_of_its_path(package, tmp_path):
    package("pkg-a", calm="Config [fast]")
    assert TRACKERS.config_of("calm")().least == 3


def test_what_a_terminal_acts_upon_is_not_printed(package, tmp_path, capsys):
    module = package("pkg-coloured", calm="Config")
    source = (tmp_path / f"{module}.py").read_text()
    source = source.replace("Stands still.", "Stands \\x1b[31mstill.").replace(
        "A number", "A \x1b[0mnumber"
    )
    (tmp_path / f"{module}.py").write_text(source)
    assert TRACKERS.summary("calm") == "Stands [31mstill."
    list_command.show("calm")
    assert "\x1b[0m" not in capsys.readouterr().out
    (tmp_path / f"{module}.py").write_text("raise ValueError('no \\x1b[31mweights\\nat all')")
    sys.modules.pop(module, None)
    with pytest.raises(kinds.UnknownKind) as refused:
        list_command.show("calm")
    assert str(refused.value).endswith("cannot be imported: no [31mweights at all")


@pytest.mark.parametrize("presets", ["'fast'", "{'fast': 3}", "[1]"])
def test_presets_that_are_no_tables_are_a_sentence(package, tmp_path, presets):
    module = package("pkg-a", calm="Config")
    file = tmp_path / f"{module}.py"
    file.write_text(file.read_text() + f"\n\nConfig.PRESETS = {presets}\n")
    sys.modules.pop(module, None)
    with pytest.raises(kinds.UnknownKind) as refused:
        list_command.show("calm")
    assert str(refused.value) == (
        "'calm': PRESETS should be a dictionary of presets by name, each a dictionary of settings"
    )
