"""Every command ends with a sentence and an exit code, whatever its output is connected to."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from preloaded import Command, ran

from servo.cli import main
from servo.cli.guard import guarded
from servo.mistake import LONGEST, Mistake, Refused
from sim.camera.gl import NoRenderer

pytestmark = pytest.mark.processes

BIN = Path(sys.executable).parent / "servobench"


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (Mistake("no such\nthing"), 2, "no such\\nthing"),
        (NoRenderer("no OpenGL here"), 2, "no OpenGL here"),
        (Refused("the disk is full"), 1, "the disk is full"),
        (OSError(28, "No space left on device", "a/b"), 1, "a/b: No space left on device"),
        (OSError(36, "File name too long", "a"), 2, "a: File name too long"),
        (OSError(24, "Too many open files"), 1, "Too many open files"),
        (
            MemoryError(),
            1,
            "this machine has too little memory for the command: end other programs first",
        ),
        (Mistake("x" * 9999), 2, f"{'x' * (LONGEST // 2)} [...] {'x' * (LONGEST // 2)}"),
    ],
)
def test_a_failure_is_a_sentence_and_an_exit_code(capsys, error, code, sentence):
    def command():
        raise error

    with pytest.raises(SystemExit) as ended:
        guarded(command)
    assert (ended.value.code, capsys.readouterr().err) == (code, f"servobench: {sentence}\n")


def test_an_error_of_our_own_keeps_its_traceback():
    def command():
        raise KeyError("a bug")

    with pytest.raises(KeyError):
        guarded(command)


def test_windows_is_named_at_the_start(capsys, monkeypatch):
    monkeypatch.setattr("platform.system", lambda: "Windows")
    with pytest.raises(SystemExit) as ended:
        guarded(lambda: None)
    sentence = "servobench: Windows is not supported: run servobench in WSL (wsl --install)\n"
    assert (ended.value.code, capsys.readouterr().err) == (2, sentence)


SETTINGS = ("run.duration=0.2", "tracker.kind=frozen", "estimator.kind=none", "expect={}")
RUN = ("run", "still", "--out", "out", "--no-rerun", *(w for s in SETTINGS for w in ("--set", s)))
FILES = ["errors.png", "report.json", "steps.parquet", "target_motion.png"]


def printed(words, where, place, **environment):
    """Exit code and stderr of a command whose output goes somewhere."""
    line = " ".join(f"'{w}'" for w in (BIN, *words))
    ended = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line} {where}"],
        cwd=place,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )
    return ended.returncode, ended.stderr


def files_in(folder):
    return sorted(path.name for path in folder.iterdir())


FULL = (1, "servobench: standard output: No space left on device\n")


def test_a_run_writes_its_files_though_nothing_can_be_printed(tmp_path):
    odd = {"PYOPENGL_PLATFORM": "nonsense", "MPLBACKEND": "nonsense"}  # does not matter either
    assert printed(RUN, "> /dev/full", tmp_path, **odd) == FULL
    assert files_in(tmp_path / "out") == FILES


def test_a_run_writes_its_files_though_its_streams_are_closed(tmp_path):
    assert ran(RUN, cwd=tmp_path, stdout=None, stderr=None) == (0, None, None)
    assert files_in(tmp_path / "out") == FILES


def test_a_run_writes_its_files_though_its_reader_is_gone(tmp_path):
    command = Command(RUN, cwd=tmp_path)
    command.stdout.close()
    assert (command.wait(), command.stderr.read()) == (0, "")
    command.stderr.close()
    assert files_in(tmp_path / "out") == FILES


@pytest.mark.parametrize(
    ("where", "end"),
    [
        (">&-", (0, "")),
        ("2>&-", (0, "")),
        (">&- 2>&-", (0, "")),
        ("| true", (0, "")),
        ("> /dev/full", FULL),
        ("> /dev/full 2> /dev/full", (1, "")),
    ],
)
def test_so_does_a_command_that_is_quick_to_start(tmp_path, where, end):
    assert printed(("new", "tracker", "mine"), where, tmp_path) == end
    assert (tmp_path / "mine" / "README.md").exists()


@pytest.mark.parametrize("words", [("list",), ("list", "camera"), ("schema",), ("--help",)])
def test_what_cannot_be_printed_ends_with_a_sentence(tmp_path, words):
    code, _, err = ran(words, cwd=tmp_path, stdout="/dev/full")
    assert (code, err) == FULL


def test_an_encoding_that_lacks_a_character_prints_another_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gr\u00fcn.toml").write_text("[run]\nduration = 0.1\n")
    words = ["run", "gr\u00fcn.toml", "--no-rerun", "--set", "tracker.kind=frozen"]
    monkeypatch.setattr(sys, "argv", ["servobench", *words])
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    stream = sys.stdout
    with pytest.raises(SystemExit) as ended:
        main.main()
    stream.flush()
    assert ended.value.code == 0
    assert b"gr?n, seed 0" in stream.buffer.getvalue()


NO_BACK_END = "the environment variable MUJOCO_GL=nonsense names no OpenGL back end: unset it, or set it to egl."


def test_an_odd_environment_is_a_sentence(tmp_path):
    said = (2, f"servobench: {NO_BACK_END}\n")
    assert printed(RUN, "", tmp_path, MUJOCO_GL="nonsense") == said


def test_loops_run_uncompiled_where_numba_is_switched_off(tmp_path):
    told = "import tracking.loops.particle_loops; print('there')"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", told]
    assert subprocess.check_output(command, env=environment, text=True) == "there\n"


def test_settings_of_dask_that_are_broken_are_named(tmp_path):
    (tmp_path / "tls.yaml").write_text("distributed: [\n")
    ended = subprocess.run(
        [BIN, "sweep", "particles"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"DASK_CONFIG": str(tmp_path)},
    )
    begin = f"servobench: Dask's settings cannot be read; correct them: A dask config file at '{tmp_path}/tls.yaml'"
    assert ended.returncode == 2
    assert ended.stderr.startswith(begin)
    assert ended.stderr.count("\n") == 1
