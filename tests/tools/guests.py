"""Small trackers of another author, and programs with them: python -m guests lines|trax REGION KIND.

The programs use nothing of servobench, as a stranger's would.
"""

import base64
import importlib
import json
import re
import sys

import numpy as np


class Drifting:
    """OpenCV's convention: drifts, grows, and sees nothing in the third picture."""

    def init(self, image, rect):
        self.rect = tuple(rect)
        self.count = 0

    def update(self, image):
        self.count += 1
        if self.count == 3:
            return False, (0, 0, 0, 0)
        x, y, width, height = self.rect
        brightness = float(image[:10].mean()) / 256  # it depends on the picture
        grown = 1.01**self.count
        return True, (
            x + 1.5 * self.count + brightness,
            y - 0.25 * self.count,
            width * grown,
            height,
        )


class DriftingFromOne(Drifting):
    """The same in GOT-10k's convention: RGB, and pixels counted from 1."""

    def init(self, image, box):
        super().init(image, whole([box[0] - 1, box[1] - 1, box[2], box[3]]))

    def update(self, image):
        seen, (x, y, width, height) = super().update(image)
        return np.array([x + 1, y + 1, width, height]) if seen else np.zeros(4)


class Turning(Drifting):
    """Reports an angle and a confidence."""

    def update(self, image):
        seen, box = super().update(image)
        return (
            {"box": box, "angle": 0.01 * self.count, "confidence": 0.8} if seen else {"seen": False}
        )


class Drawing(Drifting):
    """Draws its boxes."""

    def __init__(self, rng):
        self.rng = rng

    def update(self, image):
        x, y, width, height = self.rect
        return True, (x + float(self.rng.normal()), y, width, height)


def say(text):
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def whole(box):
    """The whole pixels nearest to the edges of a box, which OpenCV's trackers begin with."""
    x, y, width, height = box
    left, top = round(x), round(y)
    return left, top, round(x + width) - left, round(y + height) - top


def _image(data, width, height):
    return np.frombuffer(data, np.uint8).reshape(height, width, 3)[..., ::-1]


def lines(tracker):
    """Answer lines of JSON."""
    while line := sys.stdin.buffer.readline():
        asked = json.loads(line)
        answer = {}
        if "width" in asked:
            width, height = asked["width"], asked["height"]
            image = _image(sys.stdin.buffer.read(width * height * 3), width, height)
            if "box" in asked:
                tracker.init(image, whole(asked["box"]))
            else:
                seen, box = tracker.update(image)
                answer = {"box": box, "seen": seen}
        say("loading ...")  # output of its own
        say(json.dumps(answer))


def trax(tracker, region):
    """Answer a client of TraX with rectangles or polygons."""
    say(f'@@TRAX:hello "trax.version=4" "trax.region={region}" "trax.image=memory"')
    given = None
    for line in sys.stdin:
        kind, *words = re.findall(r'@@TRAX:\w+|(?<=")[^" ]+(?=")', line)
        if kind == "@@TRAX:quit":
            return
        if kind == "@@TRAX:initialize":
            given = [float(number) for number in words[0].split(",")]
            continue
        _, width, height, data = re.fullmatch(r"image:((\d+);(\d+));rgb;(.*)", words[0]).groups()
        image = _image(base64.b64decode(data), int(width), int(height))
        if given:
            xs, ys = (given[0::2], given[1::2]) if len(given) > 4 else ([], [])
            box = [min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys)] if xs else given
            tracker.init(image, whole(box))
            given = None
            say('@@TRAX:state "1,2,3,4"')
            continue
        seen, (x, y, width, height) = tracker.update(image)
        numbers = [x, y, width, height]
        if region == "polygon":
            numbers = [x, y, x + width, y, x + width, y + height, x, y + height]
        if not seen:
            numbers = [0, 0, 0, 0]
        say(f'@@TRAX:state "{",".join(map(repr, map(float, numbers)))}"')


if __name__ == "__main__":
    door, region, kind = sys.argv[1:]
    module, _, name = kind.partition(":")
    made = getattr(importlib.import_module(module), name)()
    lines(made) if door == "lines" else trax(made, region)
