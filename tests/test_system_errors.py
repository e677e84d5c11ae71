"""What the operating system refuses in the middle of work becomes the sentence it should be."""

import errno
import itertools
import os
import stat
from types import SimpleNamespace

import numpy as np
import pytest
from machines import machine_with

from servo.mistake import FULL, Mistake, Refused, refusal, unwritable
from servo.report import study_time
from servo.study.cluster import local as local_cluster
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
        remedy = "remove the cause, and run again" if number in FULL else "choose another place"
        assert str(found) == f"here: cannot write to this folder: why; {remedy}"


def chained(*causes):
    """The first of these errors, each caused by the next."""
    for error, cause in itertools.pairwise(causes):
        error.__cause__ = cause
    return causes[0]


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (DISK, "Input/output error"),
        (chained(RuntimeError("outer"), OSError(11, "try again")), "try again"),
        (OSError("odd"), "odd"),
        (RuntimeError("outer"), "outer"),
    ],
)
def test_a_cluster_that_cannot_start_is_one_sentence(monkeypatch, error, said):
    monkeypatch.setattr(local_cluster, "LocalCluster", refusing(error))
    with pytest.raises(Refused) as refused, local_cluster.local(1):
        pass
    assert str(refused.value) == (
        f"the worker processes cannot be started: {said}; use one worker, or remove the cause"
    )


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


@pytest.mark.parametrize(
    ("asked", "missing"), [("osmesa", ("libOSMesa.so.8",)), ("egl", ("libEGL.so.1", "libGL.so.1"))]
)
def test_a_back_end_that_is_asked_for_must_be_there(monkeypatch, asked, missing):
    machine_with(monkeypatch)
    monkeypatch.setenv(gl.CHOSEN_BY, asked)
    with pytest.raises(gl.NoRenderer, match=f"The OpenGL library {missing[0]} is missing"):
        gl.check_environment()
    machine_with(monkeypatch, *missing)
    monkeypatch.setenv(gl.CHOSEN_BY, asked)
    gl.check_environment()


def test_a_device_that_cannot_be_asked_is_none(monkeypatch):
    machine_with(monkeypatch, "libEGL.so.1", "libGL.so.1")
    egl = gl.sys.modules["mujoco.egl"]
    egl.create_initialized_egl_device_display = refusing(AttributeError("eglQueryDevicesEXT"))
    with pytest.raises(gl.NoRenderer, match="No OpenGL driver answers on this machine"):
        gl.backend()


def test_series_without_values_have_no_curve():
    series = [{"time_s": np.arange(3.0), "other": np.ones(3)}]
    unknown = {"time_s": np.arange(3.0), "x": np.full(3, np.nan)}
    assert study_time.band([*series, unknown], "x") is None
    assert study_time.survival(series) is None


def test_a_file_is_whole_where_folders_cannot_be_flushed(monkeypatch, tmp_path):
    real = os.fsync

    def fsync(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise DISK
        real(descriptor)

    monkeypatch.setattr(atomic.os, "fsync", fsync)
    atomic.write(tmp_path, "a", b"all of it")
    assert (tmp_path / "a").read_bytes() == b"all of it"
