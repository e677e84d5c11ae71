"""Every reader of a user's file refuses what is not a regular file, or is too large."""

import os
import socket
from pathlib import Path

import pytest

from servo.mistake import Mistake
from servo.output import formats
from servo.output.recording import view
from servo.scenario import toml
from sim.files import reading
from tracking.evaluation import track_file
from tracking.sequences import truth

READERS = {
    "truth": truth.read,
    "track": track_file.read,
    "suite": lambda path: toml.read(path, "suite"),
    "recording": view.check,
    "file": formats.content,
}


@pytest.fixture
def odd(tmp_path):
    """Paths that are not readable files, by what a message calls them."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "broken").symlink_to("gone")
    (tmp_path / "to_pipe").symlink_to("pipe")
    with socket.socket(socket.AF_UNIX) as listener:
        here = Path.cwd()
        os.chdir(tmp_path)  # a socket's path is at most 108 characters
        listener.bind("socket")
        os.chdir(here)
    return {
        tmp_path / "pipe": "it is a named pipe, not a file",
        tmp_path / "to_pipe": "it is a named pipe, not a file",
        tmp_path / "folder": "it is a folder",
        tmp_path / "socket": "it is a socket, not a file",
        Path("/dev/zero"): "it is a device, not a file",
        tmp_path / "loop": "Too many levels of symbolic links",
        tmp_path / "broken": "No such file or directory",
        tmp_path / ("a" * 300): "File name too long",
        tmp_path / "a\0b": "no file can have this name",
        tmp_path / "\ud800": "no file can have this name",
    }


@pytest.mark.parametrize("what", READERS)
def test_only_a_regular_file_is_read_and_nothing_is_waited_for(odd, what):
    for path, reason in odd.items():
        with pytest.raises(ValueError) as refused:
            READERS[what](path)
        expected = f"{path}: cannot read this {what}: {reason}"
        assert str(refused.value) in (expected, str(Mistake(expected)))


@pytest.mark.parametrize("what", READERS)
def test_a_file_that_may_not_be_read_is_named(tmp_path, monkeypatch, what):
    """The superuser of a container may read everything: the refusal is made here."""
    path = tmp_path / "secret"
    path.write_bytes(b"")

    def refuse(self, *_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ValueError, match=f"cannot read this {what}: Permission denied"):
        READERS[what](path)


def test_a_size_beyond_the_limit_is_refused_without_reading_it(tmp_path):
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(1 << 40)  # a hole: it needs no room on the disk
    with pytest.raises(ValueError) as refused:
        reading.content(path, "truth", 1000)
    assert str(refused.value) == (
        f"{path}: cannot read this truth: it is too large; the limit is 1,000 bytes"
    )


def test_a_file_that_claims_to_be_empty_is_read_up_to_the_limit():
    """Files of the kernel have a size of 0, whatever is in them."""
    path = Path("/proc/self/status")
    assert b"Name:" in reading.content(path, "file", 100_000)
    with pytest.raises(ValueError, match="it is too large; the limit is 20 bytes"):
        reading.content(path, "file", 20)


def test_the_names_of_a_folder_are_sorted_by_their_numbers(tmp_path):
    for name in ("10.png", "9.png", "b2.png", "b10.png", "010.png", "a.png"):
        (tmp_path / name).touch()
    names = [path.name for path in reading.names(tmp_path)]
    assert names == ["9.png", "010.png", "10.png", "a.png", "b2.png", "b10.png"]
    with pytest.raises(ValueError, match="cannot read this folder: No such file or directory"):
        reading.names(tmp_path / "gone")
