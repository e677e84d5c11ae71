import numpy as np
import pytest

from sim.disturbances import board, brightness
from sim.types import Effect

RNG = np.random.default_rng(0)


def test_board_hides_the_line_of_sight_for_its_duration():
    disturbance = board.Config(start=2.0, duration=0.5, slide=0.2, distance=0.6).build(RNG)
    assert disturbance.at(1.7).board is None
    assert disturbance.at(1.9).board == pytest.approx(-0.3)
    assert [disturbance.at(t).board for t in (2.0, 2.25, 2.5)] == [0.0, 0.0, 0.0]
    assert disturbance.at(2.6).board == pytest.approx(0.3)
    assert disturbance.at(2.8).board is None


def test_brightness_ramps_down_stays_and_comes_back():
    disturbance = brightness.Config(start=3.0, factor=0.5, ramp=1.0, duration=2.0).build(RNG)
    gains = [disturbance.at(t).gain for t in (0.0, 3.5, 5.0, 6.5, 9.0)]
    np.testing.assert_allclose(gains, [1.0, 0.75, 0.5, 0.75, 1.0])


def test_effects_at_once_multiply_and_keep_the_board():
    assert Effect(gain=0.5, board=0.1) | Effect(gain=0.5) == Effect(gain=0.25, board=0.1)
    assert Effect(board=0.1) | Effect(board=0.2) == Effect(board=0.2)
