"""What is timed is what it says: films with a car of the asked size."""

import pytest
import speed

from servo.loop.episode import Episode
from servo.scenario.load import load


@pytest.mark.parametrize(("length", "width"), [(30.0, 320), (60.0, 640), (120.0, 320)])
def test_a_film_shows_the_car_as_long_as_asked(length, width):
    film = speed.film(length, width, frames=3)
    assert film.region.width == pytest.approx(length, rel=1e-6)
    assert film.region.height == pytest.approx(length / 2, rel=1e-6)
    assert len(film.frames) == 3
    assert film.frames[0].image.shape == (width * 3 // 4, width, 3)
    assert (film.frames[0].image != film.frames[2].image).any()


def test_the_step_is_more_than_its_rendering_and_everything_was_recorded():
    added = []
    with Episode(load("line", ["run.duration=0.5"])) as episode:
        times = speed.times_of(episode, added.append)
    assert len(added) == 15
    assert times.step > times.render > 0.0


def test_a_light_step_keeps_its_numbers_and_the_size_of_its_image():
    with Episode(load("line", ["run.duration=0.1"])) as episode:
        step = list(episode)[-1]
    light = step.light()
    assert light.frame.image.shape == step.frame.image.shape
    assert light.frame.image.strides == (0, 0, 0)  # one byte for all pixels
    assert light.estimate.particles is None
    assert light.servo_error == step.servo_error
    assert light.truth is step.truth
