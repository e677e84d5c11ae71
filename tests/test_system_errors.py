"""What the operating system refuses in the middle of work becomes the sentence it should be."""

import errno
from types import SimpleNamespace

import numpy as np
import pytest

from servo.mistake import FULL, Mistake, Refused, refusal, unwritable
from servo.output.run_folder import RunFolder
from servo.output.sinks import Sinks
from servo.report import study_time
from servo.study.cluster import local as local_cluster
from servo.study.cluster import remote as remote_cluster
from sim import stderr
from sim.camera import gl
from sim.files import reading
from tracking.files import atomic

DISK = OSError(errno.EIO, "Input/output error")


def refusing(error=DISK):
    def refuse(*_, **__):
        raise error

    return refuse


def test_a_file_that_cannot_be_read_to_its_end(monkeypatch, tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    broken = SimpleNamespace(read=refusing(), __enter__=None, __exit__=None)

    class Opened:
        def __enter__(self):
            return broken

        def __exit__(self, *_):
            pass

    monkeypatch.setattr(reading, "opened", lambda *_: Opened())
    with pytest.raises(ValueError) as refused:
        reading.content(tmp_path / "a", "truth", 10)
    assert str(refused.value) == f"{tmp_path}/a: cannot read this truth: Input/output error"


def test_a_table_that_cannot_be_closed_names_its_rows(tmp_path):
    folder = SimpleNamespace(
        _sinks=Sinks({}), folder=tmp_path, _table=SimpleNamespace(close=refusing())
    )
    with pytest.raises(Refused) as refused:
        RunFolder.close(folder)
    assert str(refused.value) == (
        f"{tmp_path}/steps.parquet: Input/output error; all rows are in {tmp_path}/steps.arrows"
    )


def test_a_recording_that_ends_early_costs_nothing_else():
    for act in ("add", "close"):
        said, rows = Refused("it ends"), []
        begun = SimpleNamespace(add=rows.append, close=None, abandon=lambda: None)
        sinks = Sinks({"log": SimpleNamespace(**vars(begun) | {act: refusing(said)})})
        table = SimpleNamespace(add=rows.append, close=lambda rows=rows: rows.append("closed"))
        folder = SimpleNamespace(_sinks=sinks, _table=table)
        if act == "add":
            RunFolder.add(folder, "one")
            RunFolder.add(folder, "two")
        RunFolder.close(folder)
        assert str(sinks.refused) == "log: it ends too early: it ends"
        assert rows == (["one", "two", "closed"] if act == "add" else ["closed"])


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "a/b"), "a/b: No space left on device"),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (OSError("odd"), "odd"),
    ],
)
def test_an_error_is_a_sentence(error, said):
    assert refusal(error) == said


def test_a_full_machine_is_no_mistake():
    for number in (*FULL, errno.EACCES, errno.ENOTDIR):
        found = unwritable("here", OSError(number, "why"))
        assert isinstance(found, Refused if number in FULL else Mistake)
        assert str(found) == "here: cannot write to this folder: why"


def test_the_first_cause_is_named():
    deep = RuntimeError("outer")
    deep.__cause__ = OSError(11, "Resource temporarily unavailable")
    assert local_cluster._reason(deep) == "Resource temporarily unavailable"
    assert local_cluster._reason(OSError("odd")) == "odd"
    assert local_cluster._reason(RuntimeError("outer")) == "outer"
    outer = OSError("outer")
    outer.__cause__ = OSError()
    assert remote_cluster._reason(outer) == "outer"
    outer.__cause__.__cause__ = ImportError("inner")
    assert remote_cluster._reason(outer) == "inner"
    assert remote_cluster._reason(OSError()) == "OSError"
    assert remote_cluster._reason(ValueError("x")) == (
        "what answers there does not speak Dask's protocol"
    )


def test_a_cluster_that_cannot_start_is_one_sentence(monkeypatch):
    monkeypatch.setattr(local_cluster, "LocalCluster", refusing())
    with pytest.raises(Refused) as refused, local_cluster.local(1):
        pass
    assert str(refused.value) == ("the worker processes cannot be started: Input/output error")


def test_errors_name_their_file():
    for before, after in ((None, "here/a"), ("there", "there")):
        error = OSError(5, "why", before)
        with pytest.raises(OSError, match="why") as named, atomic.naming("here/a"):
            raise error
        assert named.value.filename == after


def test_a_closed_stderr_needs_no_silence(monkeypatch):
    monkeypatch.setattr(stderr.os, "dup", refusing())
    done = []
    with stderr.silent_libraries():
        done.append(1)
    assert done == [1]


@pytest.mark.parametrize("asked", ["osmesa", "egl"])
def test_a_back_end_that_is_asked_for_must_be_there(monkeypatch, asked):
    monkeypatch.setenv("MUJOCO_GL", asked)
    remedy = "'apt-get install x'"
    monkeypatch.setattr(gl, "LIBRARIES", {asked: (("libGone.so.1",), remedy)})
    with pytest.raises(gl.NoRenderer) as told:
        gl.check_environment()
    assert str(told.value) == (
        f"The OpenGL library libGone.so.1 is missing on this machine: run {remedy}."
    )
    monkeypatch.setattr(gl, "LIBRARIES", {asked: ((), remedy)})
    gl.check_environment()


@pytest.mark.parametrize(
    ("opened", "expected"),
    [
        (lambda: 1, True),
        (lambda: 0, False),
        (refusing(AttributeError("eglQueryDevicesEXT")), False),
    ],
)
def test_a_device_is_one_that_mujoco_can_open(monkeypatch, opened, expected):
    egl = SimpleNamespace(create_initialized_egl_device_display=opened)
    monkeypatch.setitem(gl.sys.modules, "mujoco.egl", egl)
    assert gl._has_device() is expected


def test_series_without_values_have_no_curve():
    series = [{"time_s": np.arange(3.0), "other": np.ones(3)}]
    unknown = {"time_s": np.arange(3.0), "x": np.full(3, np.nan)}
    assert study_time.band([*series, unknown], "x") is None
    assert study_time.survival(series) is None
    assert study_time._survival({"all": series}, "", "") is None
    assert study_time._errors({"all": [unknown]}, "x", "t", "") is None
