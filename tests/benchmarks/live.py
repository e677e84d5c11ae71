"""How far the light page is behind a run: python tests/benchmarks/live.py [SCENARIO].

For each picture that a client on this machine has received: the time since the run gave the step, with drawing, encoding
and sending. What a browser takes to show a JPEG is not in it.
"""

import http.client
import sys
import threading
import time
from urllib.parse import urlsplit

import numpy as np

import servo
from servo.output.film import RunFilm
from servo.output.light_page import PICTURES, LightPage, ThrottledSink
from servo.output.sinks import PacedSink

DURATION = 20.0
"""Simulated, and so also real, time [s]."""
HEAD_LINES = 4
"""Of each picture: what is between two, the type, the length, and an empty line."""


def main(scenario: str = "reversal") -> None:
    """Print the median and the 95th percentile."""
    page = LightPage(0)
    arrived: list[float] = []
    threading.Thread(target=receive, args=(page.page, arrived), daemon=True).start()
    given: list[float] = []

    class Noted(RunFilm):
        def add(self, step: servo.Step) -> None:
            given.append(time.monotonic())
            super().add(step)

    paced = PacedSink(ThrottledSink(Noted(page.pictures)), 1.0, lambda step: step.frame.time)
    for step in servo.run(servo.load(scenario, [f"run.duration={DURATION}"])):
        paced.add(step)
    time.sleep(1.0)
    paced.close()
    page.stop()
    # The client may miss pictures, and gets none later than the next one is drawn.
    behind = [after - max(t for t in given if t < after) for after in arrived]
    median, late = np.percentile(behind, [50, 95])
    said = f"{len(arrived)} of {len(given)} pictures: {median:.3f} s behind, 95 % {late:.3f} s\n"
    sys.stdout.write(said)


def receive(address: str, arrived: list[float]) -> None:
    """Note when each picture is complete."""
    client = http.client.HTTPConnection(urlsplit(address).netloc)
    client.request("GET", PICTURES)
    stream = client.getresponse()
    while True:
        _, _, length, _ = (stream.readline() for _ in range(HEAD_LINES))
        if not length:
            return
        stream.read(int(length.split()[1]) + len(b"\r\n"))
        arrived.append(time.monotonic())


if __name__ == "__main__":
    main(*sys.argv[1:])
