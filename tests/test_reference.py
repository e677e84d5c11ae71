import numpy as np
import pytest

from tracking.appearance.bins import ColourBins, LabelledImage
from tracking.appearance.layout import grid
from tracking.appearance.reference import (
    ANCHOR,
    RARE,
    SURROUNDINGS_RATE,
    TARGET_RATE,
    Reference,
)
from tracking.types import Region, State

REGION, STATE = Region(20.0, 20.0), State(50.0, 40.0)
RED, GREEN, BLUE = (255, 0, 0), (0, 255, 0), (0, 0, 255)
BIN = {RED: 448, GREEN: 56, BLUE: 7}


def picture(left, right, ground):
    image = np.full((80, 100, 3), ground, np.uint8)
    image[30:50, 40:50], image[30:50, 50:60] = left, right
    return image


def labelled(image):
    return LabelledImage(image, ColourBins())


def reference(image, learns=True):
    return Reference(labelled(image), REGION, STATE, grid(REGION, 1, 20), learns=learns)


def weights(ref):
    return {colour: float(ref.root_parts[0, at] ** 2) for colour, at in BIN.items()}


def test_without_learning_the_first_picture_decides():
    ref = reference(picture(RED, GREEN, BLUE), learns=False)
    ref.learn(labelled(picture(GREEN, GREEN, RED)), STATE)
    assert weights(ref) == pytest.approx({RED: 0.5, GREEN: 0.5, BLUE: 0.0})


def test_bins_that_the_surroundings_share_count_less():
    found = weights(reference(picture(RED, GREEN, RED)))
    # q = 1/2 each; the surroundings are all red: red weighs 1/2 * (1/2 / 3/2), green 1/2 * 1.
    ratio = (0.5 + RARE) / (1.5 + 2 * RARE) / ((0.5 + RARE) / (0.5 + 2 * RARE))
    assert found[RED] / found[GREEN] == pytest.approx(ratio, rel=1e-9)
    assert found[RED] + found[GREEN] == pytest.approx(1.0)


def test_the_surroundings_are_learned_anew():
    ref = reference(picture(RED, GREEN, BLUE))
    assert weights(ref)[RED] == pytest.approx(0.5, abs=1e-3)
    ref.learn(labelled(picture(RED, GREEN, RED)), STATE)
    share = (0.5 + RARE) / (0.5 + SURROUNDINGS_RATE + 2 * RARE)
    assert weights(ref)[RED] == pytest.approx(share / (share + 1), abs=1e-3)


def test_the_reference_follows_the_target_but_stays_near_the_first_appearance():
    ref = reference(picture(RED, GREEN, BLUE))
    ref.learn(labelled(picture(RED, RED, BLUE)), STATE)
    new = (1 - ANCHOR) * TARGET_RATE / 2
    assert weights(ref)[GREEN] == pytest.approx(0.5 - new, abs=1e-3)
    for _ in range(200):
        ref.learn(labelled(picture(RED, RED, BLUE)), STATE)
    assert weights(ref)[GREEN] == pytest.approx(ANCHOR * 0.5, abs=1e-3)
