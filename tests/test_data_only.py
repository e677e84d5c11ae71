"""Scenarios and suites are data: nothing in them is executed, nothing outside the run's folder is
written.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from servo.cli import main
from servo.mistake import Mistake
from servo.scenario import load as s
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.study import suites
from servo.study.sequence_run import Contender
from sim import kinds

FOLDERS = [*(folder for folder, _ in PLUGINS.values()), *LISTS.values(), suites.GENERATORS]
NO_KINDS = (
    "os",
    "json",
    "evil",
    "../../evil",
    "..",
    ".",
    "",
    "/etc/passwd",
    "__init__",
    "_opencv",
    "sim.motions.line",
    "motions.line",
    "line.py",
    "line\n",
    "Line",
    "__class__",
    "a b",
    "x" * 999,
)
NO_LABELS = (
    "../../evil",
    "..",
    ".",
    ".hidden",
    "",
    "/tmp/evil",
    "a/b",
    "a\\b",
    "c:\\evil",
    "a\nb",
    "a\0b",
    " ",
    "a ",
    "x" * 61,
)
QUICK = 'kind = "clutter"\nframes = 3\n'


@pytest.fixture
def trap(monkeypatch, tmp_path):
    """A module that leaves a mark when it is imported, where Python would find it."""
    (tmp_path / "evil.py").write_text("import pathlib\npathlib.Path('mark').touch()\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not (tmp_path / "mark").exists()
    assert "evil" not in sys.modules


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_name_that_is_no_file_of_the_folder_is_refused_and_nothing_imported(folder, trap):
    folder.names()  # imports the folder itself
    before = set(sys.modules)
    for name in NO_KINDS:
        with pytest.raises(kinds.UnknownKind, match="there is no kind"):
            folder.config_of(name)
        with pytest.raises(kinds.UnknownKind, match="there is no kind"):
            folder.preset(name, "paper")
        with pytest.raises(kinds.UnknownKind, match="there is no kind"):
            folder.summary(name)
        with pytest.raises(kinds.UnknownKind, match="there is no kind"):
            folder.presets(name)
    assert set(sys.modules) == before


@pytest.mark.parametrize("name", ["__class__", "__init__", "PRESETS", "Config", "os", "../x", ""])
def test_a_preset_is_a_name_in_a_list_and_nothing_else(name):
    with pytest.raises(Mistake) as refused:
        s.parse({"tracker": {"kind": "kams", "preset": name}}, "any", "any.toml")
    assert str(refused.value) == (
        f"any.toml: tracker.preset: there is no preset '{name}'; there is paper"
    )


@pytest.mark.parametrize("key", [*PLUGINS, *LISTS])
def test_a_scenario_that_names_a_module_is_refused(key, trap):
    path = trap / "any.toml"
    for kind in ("evil", "os", "../../evil", "sim.motions.line", "__init__"):
        table = f"[[{key}]]" if key in LISTS else f"[{key}]"
        path.write_text(f'{table}\nkind = "{kind}"\n')
        with pytest.raises(Mistake) as refused:
            s.load(str(path))
        where = f"{key}[0]" if key in LISTS else key
        said = f"any.toml: {where}.kind: there is no kind '{kind}'; there is "
        assert str(refused.value).startswith(said)


@pytest.mark.parametrize("table", ["sequences", "trackers"])
def test_a_suite_that_names_a_module_is_refused(table, trap):
    path = trap / "suite.toml"
    first = "" if table == "sequences" else f"[[sequences]]\n{QUICK}"
    for kind in ("evil", "os", "../../evil", "__init__"):
        path.write_text(f'{first}[[{table}]]\nkind = "{kind}"\n')
        with pytest.raises(Mistake, match=rf"{table}\[0\]\.kind: there is no kind"):
            suites.suite(str(path))


@pytest.mark.parametrize("label", NO_LABELS)
def test_a_label_that_is_no_name_of_a_folder_is_refused(label):
    with pytest.raises(
        ValueError,
        match="cannot name a folder: expected 1 to 60 printable characters without / and",
    ):
        Contender(label, None)


def call(monkeypatch, capfd, *arguments):
    """Exit code and stderr of a command."""
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    return ended.value.code or 0, capfd.readouterr().err


def outside(folder, own):
    """Every file and folder but those in `own`, with what the files hold."""
    return {
        path: path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
        if own not in (path, *path.parents)
    }


@pytest.fixture
def home(monkeypatch, tmp_path):
    """A folder to work in, with others around it."""
    for name in ("work", "other", "pictures"):
        (tmp_path / name).mkdir()
    for i in range(3):
        picture = np.random.default_rng(i).integers(0, 256, (40, 60, 3), np.uint8)
        cv2.imwrite(str(tmp_path / "pictures" / f"{i}.png"), picture)
    (tmp_path / "pictures" / "groundtruth.txt").write_text("20,20,12,12\n" * 3)
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path


@pytest.mark.parametrize("file", ["../other/../other/x.toml", "..toml", r"../work/$\frac$[b].toml"])
def test_a_run_writes_into_its_folder_only_whatever_its_file_is_called(
    monkeypatch, capfd, home, file
):
    Path(file).write_text("[run]\nduration = 0.1\n")
    before = outside(home, home / "work" / "runs")
    code, err = call(monkeypatch, capfd, "run", file, "--quiet", "--no-rerun")
    assert (code, err) == (0, "")
    assert outside(home, home / "work" / "runs") == before
    assert len(list((home / "work" / "runs").iterdir())) == 1


def test_a_bench_reads_other_folders_and_writes_into_its_own_only(monkeypatch, capfd, home):
    trackers = "".join(f'[[trackers]]\nkind = "frozen"\nlabel = "{i}, $x^$ [b]"\n' for i in (1, 2))
    text = f'[[sequences]]\npath = "../pictures"\n[[sequences]]\n{QUICK}{trackers}'
    Path("suite.toml").write_text(text)
    before = outside(home, home / "out")
    more = ("--seeds", "1", "--workers", "1", "--quiet", "--out", "../out")
    assert call(monkeypatch, capfd, "evaluate", "suite.toml", *more) == (0, "")
    assert outside(home, home / "out") == before
    assert (home / "out" / "tracks" / "1, $x^$ [b]" / "pictures-0.csv").exists()


@pytest.mark.parametrize("label", ["../../evil", "/tmp/evil", ""])
def test_a_bench_with_an_evil_label_exits_2_and_writes_nothing(monkeypatch, capfd, home, label):
    trackers = f'[[trackers]]\nkind = "frozen"\nlabel = "{label}"\n'
    Path("suite.toml").write_text(f"[[sequences]]\n{QUICK}{trackers}")
    before = outside(home, home / "nothing")
    code, err = call(monkeypatch, capfd, "evaluate", "suite.toml", "--out", "../out")
    assert code == 2
    assert err == (
        f"servobench: suite.toml: trackers[0].label: the label '{label}' cannot name a folder: expected 1 to 60 printable "
        "characters without / and \\, no dot in front, and no space at either end\n"
    )
    assert outside(home, home / "nothing") == before


def test_a_track_writes_into_its_folder_only(monkeypatch, capfd, home):
    before = outside(home, home / "work" / "runs")
    assert call(monkeypatch, capfd, "track", "../pictures", "--quiet")[0] == 0
    assert outside(home, home / "work" / "runs") == before
