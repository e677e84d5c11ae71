"""A correlation filter: where around the target a picture looks like what was learned of it.

Bolme, Beveridge, Draper, Lui 2010, "Visual object tracking using adaptive correlation filters"
(CVPR): numerator and denominator of the filter are averaged over pictures. Henriques, Caseiro,
Martins, Batista 2015, "High-speed tracking with kernelized correlation filters" (PAMI 37(3)): the
linear filter (DCF) on histograms of gradients, under a cosine window. Danelljan, Haeger, Khan,
Felsberg 2014, "Accurate scale estimation for robust visual tracking" (BMVC): the channels share one
denominator. Two filters that learn at different rates are averaged, which none of them does: the
slow one remembers, the fast one follows a target that turns or deforms.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sim.types import Array
from tracking.loops import correlation_filter as loops
from tracking.types import Region

# Values of the published trackers but for the rates and the smaller window.
CELLS = 576
"""Number of cells of 2 x 2 points in the window: about 24 x 24."""
AROUND = 1.5
"""Margin of the window, both sides together, over the mean of the target's sides."""
SHARP = 0.1
"""Standard deviation of the wanted answer, over the target's size."""
PENALTY = 2.56
"""Addition to the denominator: frequencies with less energy count little."""
RATES = (0.02, 0.1)
"""Weight of the present picture in the slow and in the fast filter."""
LEAST_CELLS = 4
"""Least number of cells along a side of the window."""
Spectrum = NDArray[np.complex128]


class CorrelationFilter:
    """Two correlation filters that find one target of the size `region` [px]: a slow one, which
    remembers, and a fast one, which follows changes.

    `learn` and `read` take the grey levels of a picture at `points` (P, 2), which lie in a window
    around the target. `read` sets `answer` (rows, columns), the mean output of both filters.
    """

    def __init__(self, region: Region) -> None:
        """Lay out the window around a target with a region [px]; call `learn` before `read`."""
        margin = AROUND * (region.width + region.height) / 2
        sides = np.array([region.width, region.height]) + margin
        self.step = float(math.sqrt(sides[0] * sides[1] / CELLS))
        """Distance of two cells at scale 1 [px]."""
        columns, rows = (max(round(side / self.step), LEAST_CELLS) for side in sides.tolist())
        self._shape = rows, columns
        u, v = np.meshgrid(_centred(2 * columns), _centred(2 * rows))
        self.points = self.step / 2 * np.stack([u.ravel(), v.ravel()], axis=1)
        """Points (P, 2) from the target's centre at which the picture is read, at scale 1 [px]."""
        # Without its zeros at both ends, which would only waste cells.
        self._taper = np.outer(np.hanning(rows + 2)[1:-1], np.hanning(columns + 2)[1:-1])
        self.answer = np.zeros((rows, columns))
        """Answer (rows, columns) of the averaged filters to the last window: up to about 1 where
        the target is; the middle rows // 2, columns // 2 is the centre of the window."""
        self.slow_answer = self.answer
        """Answer of the slow filter alone."""
        spread = SHARP * math.sqrt(region.width * region.height) / self.step
        down, right = np.mgrid[:rows, :columns]
        squared = (down - rows // 2) ** 2 + (right - columns // 2) ** 2
        wanted = np.fft.ifftshift(np.exp(-squared / (2 * spread**2)))
        self._wanted: Spectrum = np.fft.rfft2(wanted)
        self._filters: list[tuple[Spectrum, Array]] = []

    def read(self, levels: Array) -> None:
        """Set `answer`, the mean output of both filters, and `slow_answer`, that of the slow one:
        maps (rows, columns) over the window, up to about 1 where the target is. Call `learn` first.

        Args:
            levels: Grey levels (P,), 0..255, at the `points` of a window.
        """
        seen = self._spectrum(levels)
        answers: list[Array] = []
        for above, below in self._filters:
            product = np.sum(above * seen, axis=0) / (below + PENALTY)
            answers.append(np.fft.fftshift(np.fft.irfft2(product, self._shape)))
        self.slow_answer = answers[0]
        self.answer = np.mean(answers, axis=0)

    def learn(self, levels: Array) -> None:
        """Learn the target's picture: the first call sets both filters, each later one moves the
        slow filter by a share of 0.02 and the fast one by 0.1 towards the new picture.

        Args:
            levels: Grey levels (P,), 0..255, at the `points` of a window around the target's
                centre.
        """
        seen = self._spectrum(levels)
        above: Spectrum = np.conj(seen) * self._wanted
        below: Array = np.sum(np.abs(seen) ** 2, axis=0)
        if not self._filters:
            self._filters = [(above, below) for _ in RATES]
        self._filters = [
            ((1 - rate) * old + rate * above, (1 - rate) * energy + rate * below)
            for rate, (old, energy) in zip(RATES, self._filters, strict=True)
        ]

    @property
    def peak(self) -> Array:
        """Place (2,) of the largest value of `answer`: x and y from the centre of the window, along
        the window's axes, at scale 1 [px]; in whole cells, without interpolation.
        """
        rows, columns = self._shape
        row, column = np.unravel_index(int(np.argmax(self.answer)), self._shape)
        return self.step * np.array([float(column) - columns // 2, float(row) - rows // 2])

    def _spectrum(self, levels: Array) -> Spectrum:
        """Return the spectra (9, rows, columns // 2 + 1) of the tapered histograms of gradients."""
        rows, columns = self._shape
        gradients = loops.gradients(levels.reshape(2 * rows, 2 * columns))
        return np.fft.rfft2(gradients * self._taper)


def _centred(count: int) -> Array:
    """Return numbers (count,) that are 1 apart, with the mean 0."""
    return np.linspace((1 - count) / 2, (count - 1) / 2, count)
