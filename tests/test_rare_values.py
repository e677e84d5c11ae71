"""Values that hardly ever come: empty windows, odd pictures, axes of mixed kinds."""

import numpy as np
import pytest

from servo.mistake import Mistake
from servo.study.plan import axes_of
from sim.files import picture_file
from tracking import exported
from tracking.sequences import truth
from tracking.sequences.painted import KINDS as GENERATORS
from tracking.sequences.painted._painting import blotches


@pytest.mark.parametrize(
    ("values", "twice"),
    [
        ([1, 1.0], True),
        ([True, 1], False),
        ([0.0, -0.0], True),
        (["1", 1], False),
        ([[1, 2], [1.0, 2]], True),
        ([{"a": 1, "b": 2}, {"b": 2.0, "a": 1}], True),
    ],
)
def test_values_that_are_equal_count_as_the_same(values, twice):
    table = {"controller": {"gain": values}}
    if twice:
        with pytest.raises(Mistake, match="has the same value twice"):
            axes_of(table, "mine.toml")
    else:
        assert axes_of(table, "mine.toml")[0][0].values == tuple(values)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('x,y,w,h\n"1"2,3,4,5\n', "this is not a valid CSV file: "),
        ("x,y,w,h\n", ": this truth has no lines below its header: it needs one for each picture"),
    ],
)
def test_tables_of_truth_that_are_none(tmp_path, text, said):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(ValueError) as refused:
        truth.read(tmp_path / "a.csv")
    assert said in str(refused.value)


NO_PICTURE = "this picture cannot be decoded; known formats are JPEG, PNG, BMP, TIFF, WebP, PPM"


def test_a_picture_that_opencv_refuses_cannot_be_decoded(tmp_path, monkeypatch):
    def refuse(*_):
        raise picture_file.cv2.error("too large")

    (tmp_path / "a.ppm").write_bytes(b"P6\n2 2\n255\n" + bytes(12))
    assert picture_file.read_image(tmp_path / "a.ppm").shape == (2, 2, 3)
    monkeypatch.setattr(picture_file.cv2, "imdecode", refuse)
    with pytest.raises(ValueError) as refused:
        picture_file.read_image(tmp_path / "a.ppm")
    assert str(refused.value) == f"{tmp_path}/a.ppm: {NO_PICTURE}"


def test_a_toolkit_that_has_no_picture_is_asked_for_no_more():
    class Handle:
        def region(self):
            return None

        def frame(self):
            return ""

        def report(self, *_):
            raise AssertionError

    assert exported.run_vot(Handle(), "frozen") is None


def test_a_texture_of_wild_contrast_reaches_black_and_white_and_goes_no_further():
    found = blotches(np.random.default_rng(0), 40, 30, 1.0, np.full(3, 128.0), 900.0)
    assert (found.min(), found.max()) == (0, 255)
    assert np.mean(found == 0) == pytest.approx(np.mean(found == 255), abs=0.1)
    assert np.mean(found == 0) > 0.2


@pytest.mark.parametrize("kind", ["similarity", "texture"])
def test_noise_on_painted_pictures_reaches_black_and_white_and_goes_no_further(kind):
    config = GENERATORS.config_of(kind)(noise=100.0)
    found = config.build(np.random.default_rng(0)).source.paint(3)
    assert (found.min(), found.max()) == (0, 255)
    assert 0.01 < np.mean(found == 0) < 0.5
    assert 0.01 < np.mean(found == 255) < 0.5
