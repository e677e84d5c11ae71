"""Files are written whole or not at all, and never through a link."""

import os

import pytest

from tracking.files import atomic


def test_a_file_is_written_with_the_folders_on_its_way(tmp_path):
    path = atomic.write(tmp_path / "new", "a/b/c.txt", "gr\u00fcn\n")
    assert path == tmp_path / "new" / "a" / "b" / "c.txt"
    assert path.read_bytes() == b"gr\xc3\xbcn\n"
    assert [p.name for p in path.parent.iterdir()] == ["c.txt"]


def test_an_exception_leaves_the_older_file_as_it_was(tmp_path):
    atomic.write(tmp_path, "a.txt", "old")
    with pytest.raises(RuntimeError, match="stop"), atomic.writing(tmp_path, "a.txt") as file:
        file.write(b"half of")
        raise RuntimeError("stop")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_what_a_killed_writer_left_is_no_obstacle(tmp_path):
    (tmp_path / ".a.txt.part").write_text("half of")
    assert atomic.write(tmp_path, "a.txt", "whole").read_text() == "whole"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("name", ["a.txt", ".a.txt.part"])
def test_a_link_in_the_place_of_the_file_is_replaced(tmp_path, name):
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to(tmp_path / "precious")
    path = atomic.write(tmp_path / "out", "a.txt", "ours")
    assert (tmp_path / "precious").read_text() == "mine"
    assert not path.is_symlink()
    assert path.read_text() == "ours"


def test_the_standard_output_is_not_replaced(tmp_path):
    (tmp_path / "stdout").symlink_to("/proc/self/fd/1")  # as /dev/stdout is
    with pytest.raises(OSError, match="it is a device, not a file"):
        atomic.write(tmp_path, "stdout", "ours")
    assert (tmp_path / "stdout").is_symlink()


def test_a_folder_that_is_a_link_is_refused(tmp_path):
    (tmp_path / "precious").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "runs").symlink_to(tmp_path / "precious")
    with pytest.raises(OSError, match="nothing is written through it: replace it by a folder"):
        atomic.write(tmp_path / "out", "runs/a.txt", "ours")
    assert list((tmp_path / "precious").iterdir()) == []


def test_the_root_may_be_a_link_for_the_user_chose_it(tmp_path):
    (tmp_path / "large_disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "large_disk")
    atomic.write(tmp_path / "out", "a.txt", "ours")
    assert (tmp_path / "large_disk" / "a.txt").read_text() == "ours"


def test_who_may_read_and_write_a_new_file_is_for_the_user_to_say_and_nobody_executes_it(tmp_path):
    before = os.umask(0o027)
    with atomic.new_file(tmp_path / "new"), atomic.writing(tmp_path, "whole"):
        os.umask(before)
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o640}
    os.umask(0)
    atomic.new_file(tmp_path / "new").close()
    os.umask(before)
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o666


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    happened = []
    flush, rename = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (happened.append("flushed"), flush(fd)))
    monkeypatch.setattr(os, "rename", lambda *a: (happened.append("renamed"), rename(*a)))
    monkeypatch.setattr(os, "replace", lambda *a: (happened.append("renamed"), rename(*a)))
    atomic.write(tmp_path, "a.txt", "ours")
    assert happened == ["flushed", "renamed"]
