"""A signal at any moment of a command's start: one sentence or nothing, and no empty files."""

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

import pytest
from commands import STOPPED, begin_afresh, ended, wait_for

from servo.cli import guard, main, run_command
from servo.cli.guard import ending_signals
from servo.output import run_folder


class Closing:
    """Its finalizer runs while a signal comes."""

    def __del__(self):
        signal.raise_signal(signal.SIGTERM)


def finalize():
    Closing()


callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))
"""As those of LLVM, which are called while it compiles."""


@pytest.mark.parametrize("interrupted", [finalize, callback])
def test_a_signal_is_not_lost_where_nothing_can_be_raised(capfd, interrupted):
    began = time.monotonic()
    with ending_signals() as raised, pytest.raises(guard.StopSignal):
        interrupted()
        time.sleep(5.0)
    assert [cause.number for cause in raised] == [signal.SIGTERM]
    assert time.monotonic() - began < 3.0
    assert capfd.readouterr().err == ""


def test_other_errors_there_are_told_as_ever(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    with ending_signals():
        ctypes.CFUNCTYPE(None)(lambda: 1 // 0)()
    assert [lost.exc_type for lost in told] == [ZeroDivisionError]
    assert sys.unraisablehook == told.append
    told.clear()  # it refers to itself


def test_a_library_that_makes_another_exception_of_it_is_stopped_too(monkeypatch, capfd):
    def converted(*_, **__):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5.0)
        except KeyboardInterrupt:
            raise ValueError("a fault of mine") from None

    monkeypatch.setattr(run_command, "run", converted)
    monkeypatch.setattr(sys, "argv", ["servobench", "run", "still"])
    monkeypatch.setattr(sys, "stdout", sys.__stdout__)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(SystemExit) as end:
            main.main()
    finally:
        signal.signal(signal.SIGINT, handler)
    assert (end.value.code, capfd.readouterr().err) == (130, f"{STOPPED}\n")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # the stream's file
@pytest.mark.parametrize("place", ["StepsTable", "Sinks"])
def test_a_run_that_is_stopped_before_its_first_step_leaves_no_files(tmp_path, monkeypatch, place):
    def interrupted(*given, **named):
        real(*given, **named)
        raise KeyboardInterrupt

    real = getattr(run_folder, place)
    monkeypatch.setattr(run_folder, place, interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_command.run(
            "still", ["run.duration=0.1"], 0, tmp_path / "out", quiet=True, no_rerun=True
        )
    assert list(Path(tmp_path / "out").iterdir()) == []


TOLD = """
import sys


def tell(event, given):
    if event == "import" and given[0] == {module!r}:
        open({file!r}, "w").close()


sys.addaudithook(tell)
"""
"""Python runs a `sitecustomize` before the program: this one makes a file when a module is asked for."""


@pytest.mark.processes
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("module", ["click", "numpy", "cv2", "mujoco"])
def test_a_command_ends_in_the_middle_of_its_imports(tmp_path, number, module):
    """All come after our first module: before it, Python ends by Ctrl-C with an error of its own."""
    first, there, asked = tmp_path / "first", tmp_path / "there", tmp_path / "first" / "asked"
    first.mkdir()
    there.mkdir()
    (first / "sitecustomize.py").write_text(TOLD.format(module=module, file=str(asked)))
    command = begin_afresh("run still --out out", there, os.environ | {"PYTHONPATH": str(first)})
    wait_for(asked.exists)
    os.killpg(command.pid, number)
    code, said = ended(command)
    assert (code, said) in [(128 + number, f"{STOPPED}\n"), (-number, "")]
    assert not [path for path in there.rglob("*") if path.is_file()]


@pytest.mark.processes
def test_a_signal_that_mujoco_loses_still_ends_the_command(tmp_path):
    """Its C++ code imports this module, and drops whatever that raises."""
    itself = TOLD.replace('open({file!r}, "w").close()', "os.kill(os.getpid(), signal.SIGINT)")
    text = "import os\nimport signal\n" + itself.format(module="mujoco._callbacks")
    (tmp_path / "sitecustomize.py").write_text(text)
    path = os.environ | {"PYTHONPATH": str(tmp_path)}
    assert ended(begin_afresh("run still --out out", tmp_path, path)) == (130, f"{STOPPED}\n")
