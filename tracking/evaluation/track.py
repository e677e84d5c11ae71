"""Tracks: a tracker's estimate for each picture of a source, and the time that it took."""

import dataclasses
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sim.types import Array, Frame
from tracking.sequences.sources import Picture
from tracking.types import Estimate, Region, State, Status, Tracker, unknown_covariance


@dataclass(frozen=True, slots=True)
class Shot:
    """Result of a tracker for one picture of a source: the picture and its number, from 0 on; the
    estimate; the time that the tracker took [s], 0 if the picture could not be read; and the
    picture's width and height [px], None if it could not be read.
    """

    picture: Picture
    index: int
    """Number of the picture in its source; the first is 0."""
    estimate: Estimate
    seconds: float
    """Time that the tracker took [s]; 0 if the picture could not be read."""
    size: tuple[int, int] | None
    """Width and height of the picture [px]; None if it could not be read."""

    @property
    def blind(self) -> bool:
        """True if the picture could not be read."""
        return self.size is None

    @property
    def confidence(self) -> float:
        """Confidence 0..1: 1 - the estimate's distance; 0 if the picture could not be read."""
        return 1.0 - self.estimate.distance

    def without_picture(self) -> "Shot":
        """Return a copy in which the image and the particles are None, to save memory; its `size`
        stays.
        """
        picture = dataclasses.replace(self.picture, image=None)
        estimate = dataclasses.replace(self.estimate, particles=None)
        return dataclasses.replace(self, picture=picture, estimate=estimate)


def follow(
    tracker: Tracker, source: Iterable[Picture], region: Region, state: State
) -> Iterator[Shot]:
    """Start a tracker on the first picture, and yield a `Shot` (estimate and computing time) for
    each picture of a source.

    The estimate for the first picture is `state`, LOCKED. For a picture that cannot be decoded the
    tracker is not called: the estimate is LOST, with the last state.

    Args:
        tracker: A new tracker.
        source: The pictures.
        region: Size of the target in the first picture [px].
        state: Position [px] and angle [rad] of the target in the first picture.

    Raises:
        ValueError: The region is not valid, or the first picture cannot be read.
    """
    last = state
    follows = (True, True)
    for index, picture in enumerate(source):
        if picture.image is None:
            if index == 0:
                reason = f"the first picture cannot be read: {picture.reason}"
                raise ValueError(f"{picture.name}: {reason}")
            blind = Estimate(last, unknown_covariance(), 1.0, Status.LOST, follows)
            yield Shot(picture, index, blind, 0.0, None)
            continue
        frame = Frame(picture.image, picture.time, index)
        began = time.perf_counter()
        if index == 0:
            tracker.start(frame, region, state)
            found = Estimate(state, unknown_covariance(), 0.0, Status.LOCKED)
        else:
            found = tracker.update(frame)
        seconds = time.perf_counter() - began
        height, width = picture.image.shape[:2]
        yield Shot(picture, index, found, seconds, (width, height))
        last = found.state
        follows = found.follows


def notes(shots: Sequence[Shot]) -> list[str]:
    """Return the sentences of a source about its pictures (such as the bits that they use), each
    once.

    Args:
        shots: A tracker's results for the pictures of the source, in order.
    """
    return list(dict.fromkeys(note for shot in shots for note in shot.picture.notes))


def remarks(shots: Sequence[Shot]) -> list[str]:
    """Return sentences for the user about pictures that cannot be read, or that have another size
    than the one before, and those of the source (`notes`).

    Args:
        shots: A tracker's results for the pictures of a source, in order.
    """
    found = list[str]()
    sizes = [shot for shot in shots if shot.size is not None]
    change = next((after for before, after in pairwise(sizes) if before.size != after.size), None)
    if change is not None:
        size = " x ".join(map(str, change.size or ()))
        found.append(
            f"the pictures change their size at {change.picture.name} to {size} px; the target is "
            "searched for at the same pixels"
        )
    blind = [shot.picture for shot in shots if shot.blind]
    if blind:
        found.append(
            f"{len(blind)} of {len(shots)} pictures cannot be read, the first is "
            f"{blind[0].name} ({blind[0].reason}); their rows have the status LOST"
        )
    return [*found, *notes(shots)]


@dataclass(frozen=True, slots=True)
class Track:
    """A tracker's estimates for n pictures of a source: states x, y [px], theta [rad], scale (n,
    4); corners of the outlines (n, 4, 2) [px], in the order of `Region.corners`; confidence (n,),
    0..1; computing times (n,) [ms]; and numbers of computed histograms (n,), nan if unknown.
    """

    states: Array
    """x, y [px], theta [rad], scale (n, 4) in the image."""
    corners: Array
    """Corners (n, 4, 2) of the estimated outline in the image [px]."""
    confidence: Array
    """Confidence (n,), 0..1."""
    milliseconds: Array
    """Time that the tracker took for each picture (n,) [ms]; the first is that of its start."""
    evaluations: Array
    """Number of histograms that the tracker computed for each picture (n,)."""

    @staticmethod
    def of(shots: list[Shot], region: Region) -> "Track":
        """Return the track from a tracker's results for the pictures of a source.

        Args:
            shots: The results in order, at least one.
            region: Size of the target in the first picture [px].
        """
        found = [shot.estimate for shot in shots]
        return Track(
            np.array([(e.state.x, e.state.y, e.state.theta, e.state.scale) for e in found]),
            np.stack([e.outline(region) for e in found]),
            np.array([shot.confidence for shot in shots]),
            np.array([1e3 * shot.seconds for shot in shots]),
            np.array([float(shot.estimate.evaluations) for shot in shots]),
        )
