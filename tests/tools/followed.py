"""A tracker of another convention on a target that moves 2 px a picture."""

import numpy as np
from tracked import image

from sim.types import Frame
from tracking.types import Region, State

REGION, START = Region(30.0, 20.0), State(55.0, 40.0)


def frame(k, gone=False):
    """The target 2 px further right in each picture."""
    picture = np.full((100, 160, 3), 120, np.uint8) if gone else image(k)[..., ::-1].copy()
    picture.setflags(write=False)
    return Frame(picture, 0.1 * k, k)


def follow(config, count=6, gone=99, region=REGION, start=START):
    tracker = config.build(np.random.default_rng(3))
    tracker.start(frame(0), region, start)
    return [tracker.update(frame(k, k >= gone)) for k in range(1, count)]


class Moving:
    """Knows the speed; says (ok, rect) as OpenCV's do."""

    def init(self, image, rect):
        self.rect, self.count, self.first = rect, 0, image
        self.certainty = 1.0

    def update(self, _image):
        self.count += 1
        self.certainty = 1.0 if self.count < 4 else 0.1
        x, y, width, height = self.rect
        return self.answer(x + 2 * self.count, y, width, height)

    def answer(self, *rect):
        return True, rect
