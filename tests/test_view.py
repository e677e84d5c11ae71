"""Looking at a recording without the viewer: what is asked of it, what is said where it fails."""

import os
import signal
from dataclasses import dataclass
from pathlib import Path

import pytest

from servo.cli.guard import StopSignal
from servo.mistake import Mistake
from servo.output import local_page
from servo.output.recording import view


@dataclass
class Panel:
    origin: str
    view_id: str


class Viewer:
    """A viewer that shows a recording after so many looks at it."""

    def __init__(self, panels, looks=2):
        self.panels, self.looks, self.asked = panels, looks, []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def open(self, path):
        self.asked.append(("open", path))

    def get_state(self):
        self.looks -= 1
        self.views = self.panels if self.looks <= 0 else []
        return self

    def set_time(self, timeline, *, duration, play_state):
        self.asked.append((timeline, duration, play_state))

    def take_screenshot(self, *, view_id):
        self.asked.append(view_id)
        return b"drawn"


@pytest.fixture
def viewer(monkeypatch):
    """Stands for Rerun's viewer; time passes only by sleeping."""
    clock = [0.0]
    monkeypatch.setattr(view.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(view.time, "sleep", lambda s: clock.__setitem__(0, clock[0] + s))

    def start(*panels, looks=2):
        found = Viewer([Panel(*p) for p in panels], looks)
        monkeypatch.setattr(view.ViewerClient, "spawn", lambda **_: found)
        return found, clock

    return start


BOTH = (("/world/eye/image", "a"), ("plots/error", "b"))


@pytest.mark.parametrize(
    ("panel", "asked"), [(None, None), ("/plots/error/", "b"), ("world/eye/image", "a")]
)
def test_a_picture_is_the_view_at_a_time(viewer, tmp_path, panel, asked):
    found, clock = viewer(*BOTH)
    view.picture(tmp_path / "run.rrd", tmp_path / "out.png", 7.7, panel)
    assert found.asked == [
        ("open", str(tmp_path / "run.rrd")),
        ("sim_time", 7.7, "paused"),
        asked,
    ]
    assert (tmp_path / "out.png").read_bytes() == b"drawn"
    assert clock[0] == pytest.approx(view.POLL + view.DRAWN_AFTER)


def refused(path, png, panel=None):
    with pytest.raises(Mistake) as found:
        view.picture(path, png, 1.0, panel)
    assert not png.exists()
    return str(found.value)


def test_what_the_viewer_cannot_do_is_one_sentence(viewer, tmp_path, monkeypatch):
    png = tmp_path / "out.png"
    viewer(*BOTH)
    assert refused(tmp_path, png, "world") == (
        f"{tmp_path}: this recording has no panel 'world'; it has plots/error, world/eye/image"
    )
    _, clock = viewer(looks=10_000)
    began = clock[0]
    assert refused(tmp_path, png) == (
        f"{tmp_path}: the viewer did not load this recording within 30 s; on a busy machine, try "
        "again"
    )
    assert 30.0 < clock[0] - began < 31.0

    def fails(**_):
        raise RuntimeError("no Vulkan")

    monkeypatch.setattr(view.ViewerClient, "spawn", fails)
    assert refused(tmp_path, png).startswith(
        "the viewer cannot draw without a window: without a GPU the viewer needs the packages "
        "libvulkan1"
    )


class Window:
    """Stands for the process of Rerun's window."""

    def __init__(self, words, waited):
        self.words, self.waited, self.asked = words, list(waited), []

    def wait(self):
        self.asked.append("wait")
        found = self.waited.pop(0)
        if isinstance(found, int):
            return found
        raise found

    def terminate(self):
        self.asked.append("terminate")


@pytest.fixture
def windows(monkeypatch):
    """The windows that are opened; each gives these, one after the other, to those who wait."""
    opened = []

    def open_with(*waited):
        monkeypatch.setattr(
            view.subprocess,
            "Popen",
            lambda words: opened.append(Window(words, waited)) or opened[-1],
        )
        return opened

    return open_with


def test_the_viewer_is_opened_on_this_machine_alone(monkeypatch, tmp_path, windows):
    opened = windows(3, 3)
    monkeypatch.setenv("DISPLAY", ":0")
    assert view.show(tmp_path / "run.rrd") == 3
    assert opened[0].words[1:] == [str(tmp_path / "run.rrd"), "--bind", "127.0.0.1"]
    assert Path(opened[0].words[0]).stem == "rerun"


def test_a_viewer_is_closed_where_the_command_is_stopped(monkeypatch, tmp_path, windows):
    opened = windows(StopSignal(signal.SIGTERM), -15)
    monkeypatch.setenv("DISPLAY", ":0")
    with pytest.raises(StopSignal):
        view.show(tmp_path / "run.rrd")
    assert opened[0].asked == ["wait", "terminate", "wait"]


def test_without_a_display_only_the_browser_is_left(monkeypatch, tmp_path, windows):
    monkeypatch.setattr(local_page.sys, "platform", "linux")
    windows(0, 0)
    for name in local_page.DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(Mistake) as found:
        view.show(tmp_path / "run.rrd")
    assert str(found.value) == "there is no display here: use --web, or --png FILE for a picture"
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert view.show(tmp_path / "run.rrd") == 0


def test_the_viewer_is_the_one_that_belongs_to_the_package(viewer, monkeypatch, tmp_path, capfd):
    found, _ = viewer(*BOTH)
    asked = {}

    def spawn(**options):
        os.write(2, b"noise")
        asked.update(options)
        return found

    monkeypatch.setattr(view.ViewerClient, "spawn", spawn)
    view.picture(tmp_path / "run.rrd", tmp_path / "out.png", 1.0)
    assert capfd.readouterr().err == ""
    assert asked["executable_path"].endswith("/rerun")
    assert (asked["headless"], asked["hide_welcome_screen"]) == (True, True)
    assert 1024 < asked["port"] < 65536


def test_the_recording_of_a_folder(tmp_path):
    assert view.recording_in(tmp_path) == tmp_path / "run.rrd"
    (tmp_path / "track.rrd").touch()
    assert view.recording_in(tmp_path) == tmp_path / "track.rrd"
