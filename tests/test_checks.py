"""The contract checks of servo.testing: our parts pass, and each broken one gets its sentence."""

import dataclasses
import math

import numpy as np
import pytest
from made import Good, config_for

from servo import testing
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.testing import BrokenContract, check_features, check_tracker
from tracking.types import Region, State, Status

FOLDERS = {part: folder for part, (folder, _) in PLUGINS.items()} | LISTS
CHECKS = {part: getattr(testing, f"check_{part.removesuffix('s')}", None) for part in FOLDERS}
CHECKS["features"] = check_features
EVERY = [(part, kind) for part, folder in FOLDERS.items() for kind in folder.names()]


ALONE = [
    *(("tracker", kind) for kind in ("opencv", "program", "tag", "trax", "truth")),
    ("controller", "onnx"),
    ("controller", "program"),
]
"""Parts that need a file, a server or a certain picture; they have tests of their own."""


@pytest.mark.parametrize(("part", "kind"), [e for e in EVERY if e not in ALONE])
def test_every_shipped_kind_keeps_its_contract(part, kind):
    CHECKS[part](kind)


def changed(**changes):
    """A tracker whose estimates are changed."""

    class Changed(Good):
        def update(self, frame, ego=None):
            return dataclasses.replace(super().update(frame), **changes)

    return Changed


class Writes(Good):
    def update(self, frame, ego=None):
        frame.image[0, 0] = 0
        return super().update(frame)


class Dice(Good):
    def update(self, frame, ego=None):
        return dataclasses.replace(
            super().update(frame), state=State(np.random.default_rng().random(), 1.0)
        )


class Identity(Good):
    def start(self, frame, region, state):
        super().start(frame, region, state)
        vars(self).pop("before", None)

    def update(self, frame, ego=None):
        self.before = getattr(self, "before", frame.image)
        state = State(float(self.before is frame.image), float(self.before.sum()))
        return dataclasses.replace(super().update(frame), state=state)


class Fragile(Good):
    def update(self, frame, ego=None):
        return dataclasses.replace(super().update(frame), distance=1 / int(frame.image.any()))


class AnyRegion(Good):
    def start(self, frame, region, state):
        self.state = state


class Counts(Good):
    """It never begins to count anew."""

    count = 0

    def update(self, frame, ego=None):
        self.count += 1
        return dataclasses.replace(super().update(frame), state=State(self.count, 1.0))


class Draws(Good):
    """It draws from the generator of `build`, also when it starts."""

    def __init__(self, rng):
        self.rng = rng
        self.moved = rng.random()

    def start(self, frame, region, state):
        super().start(frame, region, state)
        self.first = self.rng.random()

    def update(self, frame, ego=None):
        state = State(self.first, self.rng.random() + self.moved)
        return dataclasses.replace(super().update(frame), state=state)


class Patient(Good):
    """LOCKED for 29 pictures: two seconds after the target, which is seen in eight, is gone."""

    def start(self, frame, region, state):
        super().start(frame, region, state)
        self.seen = 0

    def update(self, frame, ego=None):
        self.seen += 1
        status = Status.LOCKED if self.seen < 30 else Status.LOST
        return dataclasses.replace(super().update(frame), status=status)


class Nothing(Good):
    def update(self, frame, ego=None):
        return None


TRACKERS = {
    "update returned NoneType; return an Estimate": Nothing,
    "its numbers must be finite, scale above 0": changed(state=State(math.nan, 1.0)),
    "; its numbers must be finite": changed(state=State(1.0, 1.0, 0.0, 0.0)),
    "Estimate.distance is 1.5; it should be from 0 to 1": changed(distance=1.5),
    "Estimate.status is 'LOCKED'; use tracking.types.Status": changed(status="LOCKED"),
    "it should be an array (4, 4); a tracker without one": changed(covariance=np.zeros(4)),
    "its variances cannot be negative": changed(covariance=-np.eye(4)),
    "it should be an array of four points (4, 2)": changed(corners=np.zeros((4, 3))),
    "the tracker writes into frame.image; work on a copy": Writes,
    "the same pictures gave other states the second time": Dice,
    "a second start did not forget the first; reset in start all that a run changes": Counts,
    "the states differ where the caller uses one buffer for all pictures": Identity,
    "for a black picture of 160 x 120 px update should return the last state as LOST, but raised ZeroDivisionError: ": Fragile,
    "the status is LOCKED two seconds after the target has disappeared": changed(
        status=Status.LOCKED
    ),
    "start accepted a region of 0 x 20 px; raise a ValueError": AnyRegion,
    "build returned Namespace, which has no method start": lambda rng: Namespace(),
}


class Namespace:
    pass


def test_a_tracker_of_a_user_passes():
    check_tracker(config_for(Good))
    check_tracker(config_for(Good)())
    check_tracker(config_for(Draws))


@pytest.mark.parametrize("sentence", TRACKERS)
def test_a_broken_tracker_gets_its_sentence(sentence):
    with pytest.raises(BrokenContract) as broken:
        check_tracker(config_for(TRACKERS[sentence]))
    assert sentence in str(broken.value)


def test_a_target_that_is_gone_is_judged_after_two_seconds():
    with pytest.raises(BrokenContract, match=r"^the status is LOCKED two seconds after"):
        check_tracker(config_for(Patient))


@pytest.mark.parametrize(
    ("part", "sentence"),
    [
        ("nothing", "there is no kind 'nothing'; there is annealed"),
        ("no.such:Name", "'no.such:Name' cannot be imported: No module named 'no'"),
        (3, "'3' is no Config: a Config is a dataclass with a method build(rng)"),
    ],
)
def test_what_is_no_part_is_a_sentence(part, sentence):
    with pytest.raises(BrokenContract) as broken:
        check_tracker(part)
    assert str(broken.value).startswith(sentence)


def test_trackers_are_checked_on_a_target_that_goes_right_by_a_pixel_a_picture():
    """The red of the target, and the yellow disc in it, as the checked tracker sees them."""
    seen = []

    class Watching(Good):
        def start(self, frame, region, state):
            seen.append((frame, region, state))
            super().start(frame, region, state)

        def update(self, frame, ego=None):
            seen.append((frame, None, None))
            return super().update(frame, ego)

    check_tracker(config_for(Watching))
    _, region, state = seen[0]
    assert (region, state) == (Region(40.0, 20.0), State(80.0, 60.0, 0.3, 1.0))
    of_film = [frame for frame, *_ in seen[:6]]
    assert [frame.index for frame in of_film] == list(range(6))
    assert [frame.time for frame in of_film] == pytest.approx([0.1 * k for k in range(6)])
    for k, frame in enumerate(of_film):
        v, u = np.nonzero((frame.image == (30, 60, 220)).all(axis=2))
        whole = np.argwhere((frame.image == (240, 240, 60)).all(axis=2))
        np.testing.assert_allclose(whole.mean(axis=0), (62, 86 + k), atol=1e-9)
        assert len(whole) == 81
        assert (u.min(), u.max(), v.min(), v.max()) == (57 + k, 102 + k, 44, 75)
