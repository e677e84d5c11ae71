"""Anyone's class with `init` and `update` as one of our trackers."""

import dataclasses
import pickle

import cv2
import numpy as np
import pytest
from followed import REGION, START, Moving, follow, frame

from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.scenario.fill import fill
from servo.scenario.load import load
from sim import kinds
from tracking import wrap
from tracking.guests.wrap import convention_of
from tracking.types import Region, State, Status

RED = slice(0, 1)


class Bare(Moving):
    def answer(self, *rect):
        return np.array(rect, np.float32)


class Boxed:
    """GOT-10k's convention by the name of an argument."""

    def init(self, image, box):
        self.image, self.box = image, box

    def update(self, _image):
        self.box = self.box + (2, 0, 0, 0)
        return self.box


@pytest.mark.parametrize("kind", [Moving, Bare, Boxed])
def test_a_box_moves_the_centre(kind):
    found = follow(wrap(kind)())
    np.testing.assert_allclose([e.state.x for e in found], 55 + 2 * np.arange(1, 6), atol=1e-6)
    assert {(e.state.y, e.state.theta, e.state.scale) for e in found} == {(40.0, 0.0, 1.0)}
    assert {e.status for e in found} == {Status.LOCKED}
    assert {e.follows for e in found} == {(False, False)}  # the size has not changed
    assert {e.distance for e in found} == {0.0}  # seen, by its own word
    assert np.isnan(found[0].covariance).all()


def test_pictures_and_boxes_are_as_each_convention_has_them():
    ours = frame(0).image
    made = Moving(), Boxed()
    for tracker in made:
        wrap(tracker)().build(np.random.default_rng()).start(frame(0), REGION, START)
    assert made[0].rect == (40, 30, 30, 20)
    assert all(type(number) is int for number in made[0].rect)
    np.testing.assert_array_equal(made[0].first, ours[..., ::-1])
    assert made[0].first.flags.c_contiguous
    assert made[0].first.flags.writeable
    np.testing.assert_array_equal(made[1].box, [41, 31, 30, 20])  # pixels counted from 1
    np.testing.assert_array_equal(made[1].image, ours)
    assert made[1].image.flags.writeable


def test_a_convention_that_is_named_goes_before_the_one_that_is_found():
    seen = []

    class Looking(Moving):
        def init(self, image, rect):
            super().init(image, rect)
            seen.append((image[40, 45, RED], rect[0]))

    for convention in ("opencv", "got10k", None):
        follow(wrap(Looking, convention=convention)(), count=2)
    reds, lefts = zip(*seen, strict=True)
    assert lefts == (40, 41, 40)
    assert reds[0] != reds[1]
    assert reds[0] == reds[2]


def test_the_conventions_are_told_apart():
    class Theirs:
        __module__ = "got10k.trackers"

        def init(self, image, area): ...

    class Derived(Theirs):
        __module__ = "mine"

    class Bbox:
        def init(self, image, bbox): ...

    assert convention_of(cv2.TrackerMIL.create()) == "opencv"
    assert [convention_of(t) for t in (Moving(), Boxed(), Derived(), Bbox())] == [
        "opencv",
        "got10k",
        "got10k",
        "got10k",
    ]


class Growing(Moving):
    def answer(self, x, y, width, height):
        return True, (x - 4 * self.count, y, width * 1.21**self.count, height)


def test_the_size_is_the_square_root_of_the_area_once_it_changes():
    found = follow(wrap(Growing)(), count=4)
    np.testing.assert_allclose([e.state.scale for e in found], [1.0, 1.21, 1.331], rtol=1e-6)
    assert [e.follows for e in found] == [(False, False), (False, True), (False, True)]


def test_what_is_declared_counts_from_the_first_picture_on_and_nothing_else_does():
    class Sized(Growing):
        gives = ("size",)

    found = follow(wrap(Sized)(), count=4)
    np.testing.assert_allclose([e.state.scale for e in found], 1.1 ** np.arange(1, 4), rtol=1e-6)
    assert {e.follows for e in found} == {(False, True)}

    class Centred(Growing):
        gives = ()

    assert {(e.state.scale, e.follows) for e in follow(wrap(Centred)())} == {(1.0, (False, False))}

    class Wrong(Growing):
        gives = ("depth",)

    with pytest.raises(ValueError) as refused:
        follow(wrap(Wrong, name="theirs")())
    assert str(refused.value) == (
        "theirs declares that it gives 'depth'; it may give size, angle, corners"
    )


def test_opencvs_whole_numbers_leave_no_error_where_the_tracker_is_opencvs(monkeypatch):
    """A region between pixels: OpenCV's trackers begin with the nearest whole ones."""

    class Echo(Moving):
        __module__ = "cv2"

        def answer(self, *rect):
            return True, self.rect

    region, start = Region(30.4, 20.6), State(55.3, 40.2)
    found = follow(wrap(Echo)(), 3, region=region, start=start)
    assert {(round(e.state.x, 6), round(e.state.y, 6)) for e in found} == {(55.3, 40.2)}
    Echo.__module__ = "mine"
    found = follow(wrap(Echo)(), 3, region=region, start=start)
    assert {(e.state.x, e.state.y) for e in found} == {(55.0, 40.0)}


def test_a_mapping_may_have_an_angle_corners_and_a_confidence():
    class Turning(Moving):
        def answer(self, x, y, width, height):
            box = (x, y, width, height)
            return {"box": box, "angle": 0.1 * self.count, "confidence": 0.75}

    found = follow(wrap(Turning)())
    np.testing.assert_allclose([e.state.theta for e in found], 0.1 * np.arange(1, 6))
    assert {(e.follows, e.distance, e.corners) for e in found} == {((True, False), 0.25, None)}

    class Cornered(Moving):
        def answer(self, x, y, width, height):
            return {"corners": [[x, y], [x + width, y + 4], [x + width, y + height], [x, y + 18]]}

    last = follow(wrap(Cornered)())[-1]
    np.testing.assert_allclose(last.corners, [[50, 30], [80, 34], [80, 50], [50, 48]])
    assert last.follows[0] is True
    kept = follow(wrap(Growing)(follow_size=False), count=4)
    assert {e.state.scale for e in kept} == {1.0}
    assert {e.follows for e in kept} == {(False, False)}


class Bigger:
    """GOT-10k's convention, which has no whole numbers; 21 % wider in each picture."""

    def init(self, image, box):
        self.box = np.array(box)

    def update(self, _image):
        self.box = self.box - (0.105 * self.box[2], 0, -0.21 * self.box[2], 0)
        return self.box


def test_a_turned_region_keeps_its_angle_and_its_own_size():
    """The tracker gets the upright box; its changes are those of the region."""
    turned, start = Region(20.0, 10.0), State(55.25, 40.5, 0.6, 1.5)
    found = follow(wrap(Bigger)(), count=3, region=turned, start=start)
    last = found[-1].state
    assert last.theta == 0.6
    assert (last.x, last.y) == pytest.approx((55.25, 40.5), abs=1e-6)
    assert last.scale == pytest.approx(1.5 * 1.21, rel=1e-6)


def test_not_ok_is_unseen_whatever_the_box():
    class Blinking(Moving):
        def answer(self, *rect):
            return (True, rect) if self.count != 2 else (False, "anything")

    class Absent(Moving):
        def answer(self, *rect):
            return rect if self.count != 2 else (0, 0, 0, 0)

    for kind in (Blinking, Absent):
        found = follow(wrap(kind)())
        assert [e.status.name for e in found] == ["LOCKED", "UNSURE", "LOCKED", "LOCKED", "LOCKED"]
        assert found[1].distance == 1.0
        assert found[1].state == found[0].state


def test_our_histogram_judges_only_if_it_is_asked_for():
    lost = follow(wrap(Moving)(judge="histogram"), count=20, gone=5)
    assert [e.status.name for e in lost[:4]] == ["LOCKED"] * 4
    assert max(e.distance for e in lost[:4]) < 0.05
    assert (lost[4].status, lost[-1].status) == (Status.UNSURE, Status.LOST)
    sure = follow(wrap(Moving, confidence=lambda tracker: 0.9)(), count=20, gone=5)
    assert {e.status for e in sure} == {Status.LOCKED}
    assert {round(e.distance, 9) for e in sure} == {0.1}
    silent = follow(wrap(Moving)(), count=20, gone=5)
    assert {(e.status, e.distance) for e in silent} == {(Status.LOCKED, 0.0)}


class Scored(Moving):
    def certain(self):
        return np.float32(self.certainty)


@pytest.mark.parametrize("where", ["certainty", "certain", lambda tracker: tracker.certainty])
def test_a_confidence_is_an_attribute_a_method_or_a_function(where):
    found = follow(wrap(Scored, confidence=where)(least_confidence=0.3))
    assert [e.status.name for e in found] == ["LOCKED"] * 3 + ["UNSURE"] * 2
    np.testing.assert_allclose([e.distance for e in found], [0, 0, 0, 0.9, 0.9], atol=1e-6)
    assert {e.status for e in follow(wrap(Scored, confidence=where)())} == {Status.LOCKED}


def test_a_factory_may_take_a_seed_or_a_generator():
    seen = []

    def seeded(seed):
        seen.append(seed)
        return Moving()

    def random(rng, device="cpu"):
        seen.append(int(rng.integers(1 << 31)))
        return Moving()

    for factory in (seeded, seeded, random):
        follow(wrap(factory)(), count=2)
    seed = int(np.random.default_rng(3).integers(1 << 31))
    assert seen == [seed, seed, int(np.random.default_rng(seed).integers(1 << 31))]


def test_opencvs_own_classes_and_functions_are_factories():
    found = [
        [estimate.state for estimate in follow(wrap(factory)(), count=4)]
        for factory in (cv2.TrackerMIL, cv2.TrackerMIL.create, cv2.TrackerMIL_create)
    ]
    assert abs(found[0][-1].x - 61) < 6
    assert found[0] == found[1] == found[2]  # what OpenCV draws from is seeded
    assert wrap(cv2.TrackerMIL).kind == "cv2:TrackerMIL"


def test_it_is_a_config_like_any_other():
    config = wrap(Moving, confidence="certainty")
    assert kinds.kind_of(config()) == config.kind == "followed:Moving"
    assert (config().judge, config().least_confidence) == ("own", 0.0)
    assert all(kinds.field_docs(config).values())
    filled = fill(config, {"judge": "histogram", "least_confidence": 0.5}, "tracker")
    assert (filled.judge, filled.least_confidence, filled.follow_size) == ("histogram", 0.5, True)
    with pytest.raises(Mistake, match=r"tracker\.judge = 'both'"):
        fill(config, {"judge": "both"}, "tracker")
    with pytest.raises(Mistake, match="tracker: there is no key 'certainty'"):
        fill(config, {"certainty": 1}, "tracker")


def test_it_travels_to_a_worker():
    config = wrap(np.random.RandomState, confidence="x", convention="got10k", name="n")(
        least_confidence=0.7
    )
    again = pickle.loads(pickle.dumps(config))
    assert (again.kind, again.judge, again.least_confidence) == ("n", "own", 0.7)
    assert again.wrapping == config.wrapping


class Threshold:
    """Finds what has the colour of the target's middle."""

    def init(self, image, rect):
        x, y, width, height = rect
        self.colour = image[y + height // 2, x + width // 2].astype(int)

    def update(self, image):
        mask = np.abs(image.astype(int) - self.colour).sum(axis=2) < 60
        rows, columns = np.nonzero(mask)
        if len(rows) < 30:
            return False, (0, 0, 0, 0)
        (left, right), (top, bottom) = np.percentile(columns, (5, 95)), np.percentile(rows, (5, 95))
        return True, (left, top, right - left + 1, bottom - top + 1)


def test_an_instance_from_python_closes_the_loop():
    mine = Threshold()
    scenario = load("still", ["run.duration=2"])
    scenario = dataclasses.replace(scenario, tracker=wrap(lambda: mine)(follow_size=False))
    with Episode(scenario) as episode:
        steps = [step.light() for step in episode]
    start, end = (
        np.hypot(s.truth.centre[0] - 160, s.truth.centre[1] - 120) for s in (steps[0], steps[-1])
    )
    assert start > 50
    assert end < 15
    assert steps[-1].estimate.status is Status.LOCKED
