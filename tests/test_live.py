"""Watching a run or a track while it goes on: its pace, its viewer, and the end of both."""

import http.client
import os
import signal
import socket
import time
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from commands import PATIENCE, STOPPED, answers
from preloaded import Command
from preloaded import ran as ran_command
from selenium.common.exceptions import WebDriverException
from tracked import REGION, pictures

from servo.cli import outputs
from servo.mistake import Mistake
from servo.output import sinks
from servo.output.light_page import BETWEEN, PICTURES, LightPage
from servo.output.local_page import DISPLAYS
from servo.output.recording import live
from servo.output.sinks import PacedSink


class Kept:
    def __init__(self, clock):
        self.clock, self.came = clock, []

    def add(self, frame, *_):
        self.came.append((frame, self.clock[0]))

    def close(self):
        pass

    abandon = close


@pytest.mark.parametrize(("speed", "due"), [(1.0, [7.0, 7.5, 9.0, 9.3]), (4.0, [7, 7.125, 8, 8])])
def test_frames_come_at_their_times_over_the_speed_and_late_ones_at_once(monkeypatch, speed, due):
    """The third frame takes until a second after the second to compute."""
    clock = [7.0]
    monkeypatch.setattr(sinks.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(sinks.time, "sleep", lambda s: clock.__setitem__(0, clock[0] + s))
    kept = Kept(clock)
    paced = PacedSink(kept, speed, lambda frame: frame)
    for frame in (0.0, 0.5, 2.0, 2.3):
        if frame == 2.0:
            clock[0] = 8.0
        paced.add(frame, None)
    assert kept.came == [
        (f, pytest.approx(t)) for f, t in zip((0.0, 0.5, 2.0, 2.3), due, strict=True)
    ]


def test_a_port_in_use_is_named():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(Mistake) as refused:
            live.LiveViewer(web=True, port=port - 1)
    assert str(refused.value) == (
        f"--port {port - 1}: port {port} is in use; choose another one with --port"
    )


def free_ports():
    """The first of two ports that nobody uses."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            try:
                second.bind(("127.0.0.1", port + 1))
            except OSError:
                continue
            return port


def started(words, folder):
    """A command, and the address that it prints."""
    process = Command(words.split(), cwd=folder, env=without_display())
    line = process.stdout.readline()
    assert line.startswith("the page of the viewer: http://127.0.0.1:"), line
    return process, line.split()[-1]


def without_display():
    kept = {name: value for name, value in os.environ.items() if name not in DISPLAYS}
    return kept | {"COLUMNS": "200"}


WOOD = 170, 125, 80
"""The table's colour, about (RGB)."""


def camera_seen(browser):
    """Whether most of the page's first panel shows the table, which the camera sees."""
    try:
        png = np.frombuffer(browser.get_screenshot_as_png(), np.uint8)
    except WebDriverException:  # the page draws without a GPU, and is busy
        return False
    page = cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1].astype(int)
    panel = page[100 : len(page) // 2, : page.shape[1] // 2]
    return (np.abs(panel - WOOD).max(axis=2) < 45).mean() > 0.25


def gone(port):
    end = time.monotonic() + PATIENCE
    while answers(port):
        assert time.monotonic() < end
        time.sleep(0.1)


def test_the_light_page_sends_the_newest_picture_to_those_who_ask_by_its_name():
    page = LightPage(0)
    pictures = [np.full((4, 6, 3), grey, np.uint8) for grey in (10, 90, 200)]
    page.pictures.add(pictures[0], 0.0)
    page.pictures.add(pictures[1], 0.1)
    host = urlsplit(page.page).netloc

    def asked(path, name=host):
        client = http.client.HTTPConnection(host, timeout=PATIENCE)
        client.request("GET", path, headers={"Host": name})
        return client.getresponse()

    assert PICTURES in asked("/").read().decode()
    assert [asked("/other").status, asked("/", "evil.example").status] == [404, 404]
    stream = asked(PICTURES)
    shown = []
    for sent in (None, pictures[2]):
        if sent is not None:
            page.pictures.add(sent, 0.2)
        assert stream.readline() == BETWEEN
        assert stream.readline() == b"Content-Type: image/jpeg\r\n"
        length = int(stream.readline().split()[1])
        jpeg = np.frombuffer(stream.read(length + 4)[2:-2], np.uint8)
        shown.append(cv2.imdecode(jpeg, cv2.IMREAD_COLOR).mean())
    assert shown == pytest.approx([90, 200], abs=2)
    page.stop()
    assert stream.read() == BETWEEN


def test_the_light_page_says_that_its_port_is_in_use():
    page = LightPage(0)
    port = urlsplit(page.page).port
    with pytest.raises(Mistake) as refused:
        LightPage(port)
    page.stop()
    assert str(refused.value) == (
        f"--port {port}: port {port} is in use; choose another one with --port"
    )


@pytest.mark.parametrize(
    ("light", "gpu", "chosen"),
    [(None, True, False), (None, False, True), (True, True, True), (False, False, False)],
)
def test_the_light_page_is_chosen_where_there_is_no_gpu(monkeypatch, light, gpu, chosen):
    monkeypatch.setattr(outputs.gl, "has_gpu", lambda: gpu)
    monkeypatch.setattr(outputs, "LightPage", lambda port: "light")
    monkeypatch.setattr(live, "LiveViewer", lambda web, port: "rerun")
    viewer = outputs.Outputs(live=True, web=True, light=light).viewer()
    assert viewer == ("light" if chosen else "rerun")


@pytest.mark.processes
@pytest.mark.parametrize("page", ["--light", "--no-light"])
def test_a_run_is_seen_in_a_browser_that_may_be_closed(tmp_path, browser, page):
    port = free_ports()
    # Little to draw: a small page, and a second of run, after which the viewer draws no more. Rerun's
    # page is drawn without a GPU, and each of our looks at it takes from its time.
    words = "run circle --live --web --no-rerun --set tracker.kind=frozen --set expect={}"
    words = f"{words} --set run.duration=1 --set measure.after=0 {page}"
    process, address = started(f"{words} --set controller.kind=hold --port {port}", tmp_path)
    browser.set_window_size(500, 420)
    browser.get(address)
    end = time.monotonic() + 2 * PATIENCE
    while not camera_seen(browser):
        assert time.monotonic() < end, browser.get_log("browser")
        time.sleep(0.5 if page == "--light" else 5.0)
    browser.get("about:blank")
    for line in process.stdout:
        if line.startswith("press Ctrl-C"):
            break
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, err) == (0, "")
    gone(port)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        (signal.SIGINT, 130, f"{STOPPED}\n"),
        (signal.SIGTERM, 143, f"{STOPPED}\n"),
        (signal.SIGKILL, -9, ""),
    ],
)
def test_a_live_track_that_is_stopped_takes_its_server_along(tmp_path, number, code, said):
    pictures(tmp_path)
    port = free_ports()
    process, _ = started(
        f"track in --region {REGION} --live --web --rate 0.2 --port {port} --tracker frozen",
        tmp_path,
    )
    while not (tmp_path / "runs" / "in-frozen-0" / "track.csv").exists():
        time.sleep(0.05)
    time.sleep(1.0)
    assert answers(port)
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, err) == (code, said)
    gone(port)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        (signal.SIGINT, 0, ""),
        (signal.SIGTERM, 143, f"{STOPPED}\n"),
        (signal.SIGHUP, 129, f"{STOPPED}\n"),
        (signal.SIGKILL, -9, ""),
    ],
)
def test_a_recording_in_a_browser_says_where_and_takes_its_server_along(
    ran, tmp_path, number, code, said
):
    port = free_ports()
    process, address = started(f"view {ran} --web --port {port}", tmp_path)
    assert urlsplit(address).port == port + 1
    client = http.client.HTTPConnection("127.0.0.1", port + 1, timeout=PATIENCE)
    client.request("GET", "/")
    with client.getresponse() as answer:
        assert answer.status == 200
    client.close()
    assert process.stdout.readline() == "press Ctrl-C to end\n"
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, err) == (code, said)
    gone(port)
    gone(port + 1)


@pytest.mark.processes
def test_a_recording_for_which_a_port_is_in_use_is_a_sentence(ran, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        told = ran_command(["view", ran, "--web", "--port", port], cwd=tmp_path)
    assert told == (
        2,
        "",
        f"servobench: --port {port}: port {port} is in use; choose another one with --port\n",
    )
