"""Rolling shutter and automatic gain, on pictures that say when they were taken."""

from math import exp

import numpy as np
import pytest

from sim.camera.camera import CameraConfig
from sim.camera.lens import Lens, Sensor
from sim.motions import still
from sim.robots import gantry
from sim.targets import car
from sim.timing import exposures
from sim.types import Camera
from sim.world import World, WorldParts


class Clock:
    """A renderer whose pictures are as bright as the number of physics steps since the start."""

    def __init__(self, *_):
        pass

    def begin(self, data):
        picture = np.full((240, 320, 3), round(data.time * 480), np.uint8)
        return lambda: picture

    def close(self):
        pass


def frames_of(**camera):
    rng = np.random.default_rng(0)
    parts = [part.Config().build(rng) for part in (gantry, car)]
    config, motion = CameraConfig(**camera), still.Config().build(rng)
    world = World(WorldParts(*parts, motion, camera=config), rng, renderer=Clock)
    yield world.look().image
    while True:
        world.step(np.zeros(6))
        yield world.look().image


@pytest.mark.parametrize("lens", [{}, {"distortion": "fisheye", "coefficients": (0.0,) * 4}])
def test_rows_are_exposed_at_their_own_times(lens):
    """16 steps a frame; of a readout of 12 of them row v has the one nearest to 4 + 12 v / 240."""
    frames = frames_of(readout_ms=25.0, bands=13, **lens)
    assert np.all(next(frames) == 0)
    for last in (16, 32):
        rows = next(frames)[:, 160, 0].astype(int)
        wanted = last - 12 + np.rint(12 * (np.arange(240) + 0.5) / 240).astype(int)
        np.testing.assert_array_equal(rows, wanted)
        assert (rows[0], rows[-1]) == (last - 12, last)


def test_each_row_is_exposed_as_long():
    frames = frames_of(readout_ms=12.5, bands=2, exposure=0.5)
    next(frames)
    # Ends at steps 10 and 16, with sub-frames 2, 3, 5, 6 and 8 steps before.
    np.testing.assert_array_equal(next(frames)[[0, 239], 0, 0], [6, 12])


def test_a_picture_with_fewer_rows_than_bands_has_each_row_once():
    bands = exposures(CameraConfig(width=16, height=16, readout_ms=20.0, bands=64), 3334)
    shares = np.zeros(16)
    for band in bands:
        shares[band.begin : band.begin + len(band.weights)] += band.weights.ravel()
    np.testing.assert_allclose(shares, 1.0, atol=1e-6)


def test_bands_that_fall_on_one_physics_step_are_rendered_once():
    bands = exposures(CameraConfig(readout_ms=5.0, bands=64), 16)
    assert [b.steps for b in bands] == [(14,), (15,), (16,)]
    shares = np.zeros(240)
    for band in bands:
        shares[band.begin : band.begin + len(band.weights)] += band.weights.ravel()
    np.testing.assert_allclose(shares, 1.0, rtol=1e-6)


@pytest.mark.parametrize(("exposure", "begins"), [(0.02, 16), (0.04, 15), (0.5, 8)])
def test_an_exposure_shorter_than_half_a_physics_step_is_none(exposure, begins):
    (band,) = exposures(CameraConfig(exposure=exposure), 16)
    assert (band.steps[0], band.steps[-1]) == (begins, 16)


def test_the_slope_is_right_wherever_the_target_is():
    """Eight pictures in 25 ms; rows of their own moments would be off by up to a half in places."""
    bands = exposures(CameraConfig(readout_ms=25.0), 16)
    assert len(bands) == 8
    moments = np.zeros(240)
    for band in bands:
        rows = slice(band.begin, band.begin + len(band.weights))
        moments[rows] += band.weights.ravel() * band.steps[-1]
    for first in range(0, 200, 10):
        rows = np.arange(first, first + 40)
        assert np.polyfit(rows, moments[rows], 1)[0] == pytest.approx(12 / 240, rel=0.01)


def test_a_readout_longer_than_a_frame_is_refused():
    with pytest.raises(ValueError) as found:
        CameraConfig(readout_ms=30.0, exposure=0.2)
    assert str(found.value) == (
        "readout_ms = 30 and the exposure do not fit into a frame at 30 Hz: lower readout_ms, "
        "exposure or rate"
    )


def test_the_gain_brings_the_brightness_back_in_its_time():
    """What is left of the change, as a ratio, falls by exp(-t / auto_gain)."""
    config = CameraConfig(auto_gain=0.5, rate=30.0)
    camera = Camera(fx=100.0, fy=100.0, cx=160.0, cy=120.0, width=320, height=240)
    sensor = Sensor(config, Lens(camera), np.random.default_rng(0))
    picture = np.full((240, 320, 3), 200, np.uint8)
    levels = [int(sensor.develop([picture], gain)[0, 0, 0]) for gain in (1.0, *[0.5] * 31)]
    assert levels[:2] == [200, 100]
    assert levels[16] == pytest.approx(200 * 0.5 ** exp(-0.5 / 0.5), abs=1.0)
    for _ in range(200):
        dark = sensor.develop([picture], 0.01)
    assert dark.max() == 16  # the gain ends at 8
    sensor = Sensor(config, Lens(camera), np.random.default_rng(0))
    sensor.develop([picture], 0.01)
    for _ in range(200):
        bright = sensor.develop([picture], 1.0)
    assert (bright == 200 / 8).all()  # and at 1/8


@pytest.mark.parametrize("readout_ms", [10.0, 25.0])
@pytest.mark.parametrize("speed", [6.0, 20.0, 60.0])
def test_a_moving_bar_leans_as_its_rows_are_exposed(monkeypatch, speed, readout_ms):
    """The centroid of each row, against the bar's place at the row's own time; speed [px a frame],
    with the 8 bands that are shipped."""

    def bar(self, data):
        left = 60 + speed * data.time * 30
        # As much of each pixel is white as the bar covers.
        row = np.clip(np.arange(1, 321) - left, 0, 1) - np.clip(np.arange(1, 321) - left - 40, 0, 1)
        picture = np.repeat(np.rint(255 * np.tile(row, (240, 1)))[..., None], 3, axis=2)
        return lambda: picture.astype(np.uint8)

    monkeypatch.setattr(Clock, "begin", bar)
    frames = frames_of(readout_ms=readout_ms)
    next(frames)
    rows = next(frames)[..., 0].astype(float)
    centres = rows @ np.arange(320) / rows.sum(axis=1)
    slope = np.polyfit(np.arange(240), centres, 1)[0]
    assert slope == pytest.approx(speed * 30 * readout_ms / 1e3 / 240, rel=0.01)
