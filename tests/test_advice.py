"""Advice on a tracker from the first picture: a line where it is a poor choice, else nothing."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from tracking.advice import NO_ANGLE, advice
from tracking.sequences import painted
from tracking.trackers import KINDS
from tracking.types import Region, State

PLAIN = ("kams", "hybrid", "sok", "mean_shift", "camshift", "cv_mean_shift")
LAYOUT = ("pf_ssd", "mk_ssd", "mk_pf")


def mug(handle=True):
    """A plain blue mug from above on a rough ground; its handle makes the region longer."""
    rough = cv2.GaussianBlur(np.random.default_rng(0).normal(0, 1, (240, 320, 3)), (0, 0), 6)
    image = np.clip(150 + 60 * rough / rough.std(), 0, 255).astype(np.uint8)
    cv2.circle(image, (148, 120), 26, (30, 60, 160), -1)
    if handle:
        cv2.rectangle(image, (170, 117), (205, 122), (30, 60, 160), -1)
        return image, Region(84.0, 52.0), State(164.0, 120.0)
    return image, Region(52.0, 52.0), State(148.0, 120.0)


def said(kind, picture, **settings):
    return advice(KINDS.config(kind, **settings), *picture)


@pytest.mark.parametrize("kind", PLAIN)
def test_a_target_that_does_not_fill_its_region_is_nothing_for_one_histogram(kind):
    line = said(kind, mug())
    begin = f"{kind} is a poor choice for this target: shown the first picture again, it settles "
    assert line.startswith(begin)
    assert line.endswith(" px beside it; pf_ssd: 0.0 px")
    assert 3 < float(line.removeprefix(begin).split()[0]) < 15


@pytest.mark.parametrize(
    ("better", "instead"),
    [("kams", "; kams: 5.1 px"), ("cv_mean_shift", ""), ("camshift", "")],
)
def test_another_tracker_is_named_where_it_is_less_than_half_as_far_off(
    monkeypatch, better, instead
):
    monkeypatch.setattr("tracking.advice.BETTER", better)
    assert said("camshift", mug()).endswith(f"it settles 12.8 px beside it{instead}")


@pytest.mark.parametrize("kind", LAYOUT)
def test_where_a_tracker_does_well_nothing_is_said(kind):
    assert said(kind, mug()) == ""


@pytest.mark.parametrize("kind", [*LAYOUT, "kernel_pf"])
def test_an_angle_that_cannot_be_seen_is_named(kind):
    assert said(kind, mug(handle=False)) == NO_ANGLE
    assert said("kams", mug(handle=False)) == ""


def test_an_angle_that_nobody_asks_for_is_not_named():
    assert said("mk_pf", mug(handle=False), turn_noise=0.0) == ""


def test_a_tracker_that_does_not_recognise_the_first_picture_is_a_poor_choice():
    """A grey target has no hue."""
    image = np.random.default_rng(1).integers(150, 200, (240, 320, 1), dtype=np.uint8)
    image[100:140, 130:190] -= 100
    picture = np.repeat(image, 3, axis=2), Region(60.0, 40.0), State(160.0, 120.0)
    assert said("cv_mean_shift", picture) == (
        "cv_mean_shift is a poor choice for this target: shown the first picture again, it does "
        "not recognise it; pf_ssd: 0.1 px"
    )


def first_of(kind):
    sequence = painted.KINDS.config(kind).build(np.random.default_rng(0))
    return next(iter(sequence.source)).image, sequence.region, sequence.start


@pytest.mark.parametrize("kind", ["clutter", "similarity"])
@pytest.mark.parametrize("tracker", ["kams", "pf_ssd", "annealed", "texture_pf"])
def test_nothing_is_said_of_the_painted_targets(kind, tracker):
    assert said(tracker, first_of(kind)) == ""


@pytest.mark.parametrize(("tracker", "poor"), [("pf_ssd", 1), ("kams", 1), ("texture_pf", 0)])
def test_a_target_in_the_colours_of_its_ground_needs_its_texture(tracker, poor):
    assert said(tracker, first_of("camouflage")) == poor * (
        f"{tracker} is a poor choice for this target: target and surroundings have the same colours: "
        "choose texture_pf, which also uses texture"
    )


def test_trackers_of_others_are_not_started_twice():
    @dataclass(frozen=True)
    class Config:
        def build(self, rng):
            raise AssertionError

    assert advice(Config(), *mug()) == ""
    assert (
        said("opencv", mug())
        == said("trax", mug())
        == said("tag", mug())
        == said("truth", mug())
        == ""
    )
