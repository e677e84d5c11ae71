"""`track --select`: the page, and a real mouse in Chromium on it."""

import http.client
import json
import socket
import struct
import threading
import time
from urllib.parse import urlsplit

import numpy as np
import pytest
from tracked import FRAMES, call, pictures, rows_of

from servo.cli import region_page
from servo.output import local_page


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in local_page.DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    return pictures(tmp_path)


def during(monkeypatch, act):
    """Let a thread act on the page's address while a command waits; a function gives its result."""
    results = []

    def say(_, *lines):
        text = "\n".join(lines)
        printed.append(text)
        if "http://" in text:
            address = text.split("page: ")[1].split()[0]
            thread = threading.Thread(target=lambda: results.append(act(address)), daemon=True)
            threads.append(thread)
            thread.start()

    printed, threads = [], []
    monkeypatch.setattr(region_page, "plain", say)

    def finished():
        threads[0].join(20)
        return results[0], printed

    return finished


def sent(address, body=None, path=None, host=None):
    """Status of a request to the page."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=10)
    headers = {"Host": host or parts.netloc}
    method = "GET" if body is None else "POST"
    connection.request(method, path or parts.path, body, headers)
    return connection.getresponse().status


def test_only_the_right_address_and_a_region_are_an_answer(monkeypatch, capfd, folder):
    def act(address):
        bad = ['"', "[1,2,3,4]", "[1,2,3,4,NaN]", "{}", "7", "[1,2,3,4,5,6]", "[" * 5000]
        bad += ['"12345"', '["1","2","3","4","5"]', "[true,2,3,4,5]", "null", "[1,2,3,4,1e999]"]
        return [
            sent(address, path="/"),
            sent(address, path="/x", body="[40,30,30,20,0]"),
            sent(address, host="evil.example"),
            *(sent(address, body) for body in bad),
            sent(address),
            sent(address, "[40, 30, 30, 20, 0]"),
        ]

    finished = during(monkeypatch, act)
    code, _, err = call(monkeypatch, capfd, "in", "--select", "--tracker", "frozen", "--out", "out")
    statuses, printed = finished()
    assert (code, err) == (0, "")
    assert statuses == [404, 404, 404, *[400] * 12, 200, 200]
    assert printed[1] == "to choose the same region again: --region 40,30,30,20"
    report = json.loads((folder / "out" / "report.json").read_text())
    assert "--region 40,30,30,20" in report["command"]
    assert "--select" not in report["command"]
    rows = rows_of(folder / "out" / "track.csv")
    assert len(rows) == FRAMES
    assert [float(rows[0][k]) for k in ("x", "y", "width", "height")] == [55, 40, 30, 20]


def test_a_client_that_resets_its_connection_is_not_heard(monkeypatch, capfd, folder):
    def act(address):
        parts = urlsplit(address)
        for request in (b"", f"GET {parts.path} HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n".encode()):
            with socket.create_connection((parts.hostname, parts.port)) as client:
                client.sendall(request)
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        time.sleep(0.3)
        return sent(address, "[40, 30, 30, 20, 0]")

    finished = during(monkeypatch, act)
    code, _, err = call(monkeypatch, capfd, "in", "--select", "--tracker", "frozen", "--out", "out")
    assert finished()[0] == 200
    assert (code, err) == (0, "")


CANCELLED = "servobench: --select: no region was drawn; run again, or give --region X,Y,W,H[,DEG]\n"


def test_a_page_that_is_cancelled_is_a_sentence(monkeypatch, capfd, folder):
    finished = during(monkeypatch, lambda address: sent(address, '"cancelled"'))
    code, _, err = call(monkeypatch, capfd, "in", "--select", "--out", "out")
    assert finished()[0] == 200
    assert (code, err) == (2, CANCELLED)
    assert not (folder / "out").exists()


def test_a_page_that_nobody_answers_is_a_sentence(monkeypatch, capfd, folder):
    monkeypatch.setattr(region_page, "PATIENCE", 0.2)
    code, _, err = call(monkeypatch, capfd, "in", "--select", "--out", "out")
    assert code == 2
    first, _, last = err.splitlines()
    address = first.removeprefix("draw the region on this page: ")
    assert address.startswith("http://127.0.0.1:")
    assert last == (
        f"servobench: --select: nobody drew a region on {address} within 0.2 s; give --region "
        "X,Y,W,H[,DEG]"
    )


def drag(browser, *points):
    """A drag of the real mouse between points of the picture [px]."""
    from selenium.webdriver.common.actions.action_builder import ActionBuilder

    a, e, f = browser.execute_script(
        "const m = document.getElementById('view').getScreenCTM(); return [m.a, m.e, m.f]"
    )
    actions = ActionBuilder(browser, duration=20)
    mouse = actions.pointer_action
    for k, (x, y) in enumerate(points):
        mouse.move_to_location(round(e + a * x), round(f + a * y))
        if k == 0:
            mouse.pointer_down()
    mouse.pointer_up()
    actions.perform()
    return a


def shape(browser):
    text = browser.execute_script("return document.getElementById('text').textContent")
    return [
        float(word)
        for word in text.replace(",", "")
        .replace(";", " ")
        .replace("°", "")
        .replace("x", "")
        .replace("px", "")
        .replace("p", "")
        .split()
    ]


def four_shapes(browser):
    """Draw a region, and take it by its middle, its lower right corner, and the dot that turns."""
    shapes = []
    for points in ([(38, 28), (60, 40), (68, 48)], [(50, 40), (52, 42)], [(70, 50), (72, 54)]):
        zoom = drag(browser, *points)
        shapes.append(shape(browser))
    centre, reach = np.array([56, 42]), np.array([0, -12 - 28 / zoom])
    turned = np.array([[0.5, -(3**0.5) / 2], [3**0.5 / 2, 0.5]]) @ reach  # by 60 degrees
    drag(browser, centre + reach, centre + turned)
    return [*shapes, shape(browser)]


@pytest.mark.processes
def test_a_region_is_drawn_moved_resized_and_turned_in_a_browser(
    monkeypatch, capfd, folder, browser
):
    browser.set_window_size(1000, 760)

    def act(address):
        browser.get(address)
        shapes = four_shapes(browser)
        browser.save_screenshot(str(folder / "page.png"))
        browser.find_element("id", "track").click()
        return shapes, [entry["message"] for entry in browser.get_log("browser")]

    finished = during(monkeypatch, act)
    code, _, err = call(monkeypatch, capfd, "in", "--select", "--tracker", "frozen", "--out", "out")
    (shapes, messages), printed = finished()
    assert (code, err) == (0, "")
    assert [m for m in messages if "favicon" not in m] == []
    expected = [
        (38, 28, 30, 20, 0), (40, 30, 30, 20, 0), (40, 30, 32, 24, 0), (40, 30, 32, 24, 60),
    ]  # fmt: skip
    for found, right in zip(shapes, expected, strict=True):
        assert found == pytest.approx(right, abs=0.4)
    row = rows_of(folder / "out" / "track.csv")[0]
    given = [float(row[k]) for k in ("x", "y", "width", "height")]
    assert given == pytest.approx([56, 42, 32, 24], abs=0.4)
    assert float(row["theta"]) == pytest.approx(np.radians(60), abs=0.02)
    again = printed[1].removeprefix("to choose the same region again: --region ")
    call(monkeypatch, capfd, "in", "--region", again, "--tracker", "frozen", "--out", "two", "-q")
    assert rows_of(folder / "two" / "track.csv")[0]["x1"] == row["x1"]


@pytest.mark.processes
def test_a_page_may_be_left_and_loaded_again(monkeypatch, capfd, folder, browser):
    def act(address):
        browser.get(address)
        browser.get("about:blank")
        browser.get(address)
        drag(browser, (38, 28), (60, 40), (68, 48))
        there = shape(browser)
        browser.find_element("id", "cancel").click()
        return there

    finished = during(monkeypatch, act)
    code, _, err = call(monkeypatch, capfd, "in", "--select", "--out", "out")
    assert finished()[0] == pytest.approx((38, 28, 30, 20, 0), abs=0.4)
    assert (code, err) == (2, CANCELLED)


def test_where_there_is_a_desktop_the_browser_is_opened(monkeypatch, capfd, folder):
    opened = []
    monkeypatch.setenv(local_page.DISPLAYS[0], ":0")
    monkeypatch.setattr("webbrowser.open", opened.append)
    during(monkeypatch, lambda address: sent(address, '"cancelled"'))
    code, _, err = call(monkeypatch, capfd, "in", "--select", "--out", "out")
    assert (code, err) == (2, CANCELLED)
    assert opened[0].startswith("http://127.0.0.1:")
