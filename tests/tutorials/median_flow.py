"""A tracker of one's own, with nothing of servobench in it: median flow (Kalal, Mikolajczyk, Matas,
Forward-Backward Error: Automatic Detection of Tracking Failures, 2010).
"""

import cv2
import numpy as np


class MedianFlow:
    """Points of a grid go along with the optical flow; the half that comes back best counts."""

    def init(self, image, rect):  # BGR; left, top, width, height [px]
        self.grey, self.rect = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.array(rect, float)

    def update(self, image):
        before, self.grey = self.grey, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        if self.grey.shape != before.shape:  # `check_tracker` asked for this line
            return False, tuple(self.rect)
        (left, top, width, height), steps = self.rect, np.linspace(0.1, 0.9, 10)
        grid = np.stack(np.meshgrid(left + steps * width, top + steps * height), axis=-1)
        points = grid.reshape(-1, 1, 2).astype(np.float32)
        there, _, _ = cv2.calcOpticalFlowPyrLK(before, self.grey, points, None)
        back, _, _ = cv2.calcOpticalFlowPyrLK(self.grey, before, there, None)
        error = np.linalg.norm(back - points, axis=2).ravel()
        good = error <= np.median(error)
        old, new = points[good, 0], there[good, 0]
        if np.median(error) > 3.0 or not np.isfinite(new).all():
            return False, tuple(self.rect)
        spread = [np.linalg.norm(p - np.median(p, axis=0), axis=1).mean() for p in (old, new)]
        scale = spread[1] / spread[0] if spread[0] > 0 else 1.0
        centre = self.rect[:2] + self.rect[2:] / 2 + np.median(new - old, axis=0)
        size = np.clip(self.rect[2:] * scale, 4.0, 1000.0)
        self.rect = np.concatenate([centre - size / 2, size])
        return True, tuple(self.rect)
