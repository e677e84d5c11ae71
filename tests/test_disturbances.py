import numpy as np
import pytest

from sim.disturbances import board, brightness, dropped_frames, second_target, spot
from sim.types import Effect, Spot

RNG = np.random.default_rng(0)


def test_board_hides_the_line_of_sight_for_its_duration():
    disturbance = board.Config(start=2.0, duration=0.5).build(RNG)
    assert disturbance.at(1.7).board is None
    assert disturbance.at(1.9).board == pytest.approx(-0.3)
    assert [disturbance.at(t).board for t in (2.0, 2.25, 2.5)] == [0.0, 0.0, 0.0]
    assert disturbance.at(2.6).board == pytest.approx(0.3)
    assert disturbance.at(2.8).board is None


def test_a_board_is_there_from_the_first_moment_of_its_slide_to_the_last():
    at = board.Config(start=2.0, duration=0.5).build(RNG).at
    assert [at(t).board for t in (1.8, 2.7)] == [-0.6, 0.6]
    assert [at(t).board for t in (np.nextafter(1.8, 0), np.nextafter(2.7, 3))] == [None, None]


def test_brightness_ramps_down_stays_and_comes_back():
    disturbance = brightness.Config(start=3.0, factor=0.5, ramp=1.0, duration=2.0).build(RNG)
    gains = [disturbance.at(t).gain for t in (0.0, 3.5, 5.0, 6.5, 9.0)]
    np.testing.assert_allclose(gains, [1.0, 0.75, 0.5, 0.75, 1.0])


def test_effects_at_once_multiply_and_keep_the_board():
    assert Effect(gain=0.5, board=0.1) | Effect(gain=0.5) == Effect(gain=0.25, board=0.1)
    assert Effect(board=0.1) | Effect(board=0.2) == Effect(board=0.2)


def test_a_board_that_stops_aside_goes_back_where_it_came_from():
    disturbance = board.Config(start=2.0, duration=1.0, offset=0.2).build(RNG)
    assert [disturbance.at(t).board for t in (2.0, 2.5, 3.0)] == [-0.2] * 3
    assert disturbance.at(3.1).board == pytest.approx(-0.4)


def test_a_second_target_comes_drives_and_goes():
    disturbance = second_target.Config(start=3.0, duration=2.0, x=0.1, y=-0.5).build(RNG)
    assert disturbance.props == ("second_target",)
    assert disturbance.at(2.9).second is None
    np.testing.assert_allclose(disturbance.at(4.0).second.translation, [0.1, -0.3, 0.0], atol=1e-12)
    assert disturbance.at(5.1).second is None


def test_a_spot_fades_in_while_the_lamp_dims():
    disturbance = spot.Config(start=3.0, ramp=1.0, duration=2.0, x=0.2)
    at = disturbance.build(RNG).at
    assert at(2.0) == Effect()
    assert at(3.5) == Effect(lamp=0.75, spot=Spot(0.2, 0.0, 0.2))
    assert at(5.0) == Effect(lamp=0.5, spot=Spot(0.2, 0.0, 0.4))


def test_frames_are_dropped_as_often_as_asked_and_alike_at_every_rate():
    drops = dropped_frames.Config(share=0.3).build(np.random.default_rng(4))
    assert not any(drops.at(t).dropped for t in np.linspace(0, 0.49, 50))
    found = [drops.at(0.5 + 0.03 * (k + 0.5)).dropped for k in range(2000)]
    assert np.mean(found) == pytest.approx(0.3, abs=0.04)  # four standard deviations of 2000 draws
    assert drops.at(0.51 + 0.03 * 7).dropped == drops.at(0.53 + 0.03 * 7).dropped
