"""What is no picture, or no region, is refused in one sentence by every tracker of ours.

The compiled loops read memory: a picture of another type must not reach them.
"""

import numpy as np
import pytest

from sim.types import Frame
from tracking import create
from tracking.types import Region, State

RGB = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
KINDS = ("kams", "mean_shift", "texture_pf", "mk_ssd", "pf_ssd", "camshift", "homography")
"""One of each way in which pictures are read."""
PICTURES = {
    "120 x 160 of uint8": RGB[..., 0],
    "120 x 160 x 4 of uint8": np.dstack([RGB, RGB[..., :1]]),
    "120 x 160 x 2 of uint8": RGB[..., :2],
    "3 x 120 x 160 of uint8": RGB.transpose(2, 0, 1),
    "1 x 120 x 160 x 3 of uint8": RGB[None],
    "0 x 160 x 3 of uint8": RGB[:0],
    "120 x 160 x 3 of float64": RGB / 255.0,
    "120 x 160 x 3 of float32": RGB.astype(np.float32),
    "120 x 160 x 3 of uint16": RGB.astype(np.uint16) * 256,
    "120 x 160 x 3 of int64": RGB.astype(np.int64),
    "120 x 160 x 3 of bool": RGB > 128,
    "120 x 160 x 3 of object": RGB.astype(object),
}


def started(kind, image=RGB, region=(40.0, 30.0)):
    tracker = create(kind, seed=1)
    tracker.start(Frame(image, 0.0, 0), Region(*region), State(80.0, 60.0))
    return tracker


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", PICTURES)
def test_what_is_no_picture_is_refused(kind, shape):
    said = (
        "expected an RGB picture with at least one pixel, an array (height, width, 3) of uint8, "
        f"got one of {shape}"
    )
    with pytest.raises(ValueError, match="picture") as refused:
        started(kind, PICTURES[shape])
    assert str(refused.value) == said
    tracker = started(kind)
    with pytest.raises(ValueError, match="picture") as refused:
        tracker.update(Frame(PICTURES[shape], 0.1, 1))
    assert str(refused.value) == said


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("thing", [None, "picture.png", [[1, 2, 3]]])
def test_what_is_no_array_is_refused(kind, thing):
    said = f"expected a picture, an array (height, width, 3) of uint8, got {thing!r}"
    with pytest.raises(ValueError, match="picture") as refused:
        started(kind, thing)
    assert str(refused.value) == said


@pytest.mark.parametrize("kind", KINDS)
def test_views_of_a_picture_are_pictures(kind):
    for image in (RGB[::-1], np.asfortranarray(RGB), RGB[:60, :80], RGB[:1, :1]):
        found = started(kind).update(Frame(image, 0.1, 1))
        assert np.isfinite([found.state.x, found.state.y, found.state.scale]).all()


def test_a_region_that_is_too_small_for_mil_is_refused():
    """OpenCV would draw features without end."""
    with pytest.raises(ValueError, match="MIL") as refused:
        started("cv_mil", region=(4.0, 4.0))
    assert str(refused.value) == (
        "the region is 4 x 4 px; OpenCV's MIL needs a side of at least 5 px: give a larger region"
    )
    started("cv_mil", region=(4.0, 6.0))
