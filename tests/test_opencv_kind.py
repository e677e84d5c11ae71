"""OpenCV's trackers by name: with model files, without, and with what cannot be used."""

import cv2
import numpy as np
import pytest
import tiny_onnx

from servo.mistake import Mistake
from servo.scenario.load import load
from sim.types import Frame
from tracking.guests import cv2_tracker
from tracking.trackers.opencv import Config
from tracking.types import Region, State, Status

REGION, START = Region(30.0, 20.0), State(65.0, 50.0)


def frame(k, gone=False):
    """A blue target on grey that goes 2 px to the right."""
    image = np.full((120, 160, 3), 110, np.uint8)
    if not gone:
        image[40:60, 50 + 2 * k : 80 + 2 * k] = (30, 30, 220)
    return Frame(image, 0.1 * k, k)


def follow(config, count=3, gone=99):
    tracker = config.build(np.random.default_rng(0))
    tracker.start(frame(0), REGION, START)
    return [tracker.update(frame(k, k >= gone)) for k in range(1, count)]


@pytest.fixture
def vit(tmp_path):
    """A network that finds what is blue."""
    path = tmp_path / "vit.onnx"
    path.write_bytes(tiny_onnx.vit((0.31, 0.21)))
    return path


@pytest.mark.parametrize("judge", [{"judge": "histogram"}, {"least_confidence": 0.3}])
def test_vit_follows_with_a_model_and_loses(vit, judge, capfd):
    config = Config(name="Vit", model=str(vit), **judge)
    found = follow(config, count=40, gone=21)
    for k in range(20):
        assert found[k].state.x - START.x == pytest.approx(2 * (k + 1), abs=14)  # two cells
        assert found[k].state.y == pytest.approx(50, abs=14)
    assert found[19].state.x - START.x > 20
    assert [found[k].status for k in (4, 20, 38)] == [Status.LOCKED, Status.UNSURE, Status.LOST]
    assert found[4].follows[0] is False
    if "judge" not in judge:
        assert found[4].distance < 0.1
    assert capfd.readouterr() == ("", "")  # OpenCV writes warnings of its own


def test_one_model_may_be_a_text_and_several_a_list(vit, tmp_path):
    for model in (f"'{vit}'", f"['{vit}']"):
        read = load("still", ["tracker.kind=opencv", "tracker.name=Vit", f"tracker.model={model}"])
        assert len(follow(read.tracker)) == 2
    with pytest.raises(Mistake, match=r"tracker\.model.*1"):
        load("still", ["tracker.kind=opencv", "tracker.model=1"])


def test_mil_is_the_default_and_repeats_by_its_seed():
    once, again = follow(Config(), count=6), follow(Config(), count=6)
    assert [e.state for e in once] == [e.state for e in again]
    assert {e.follows for e in once} == {(False, False)}


def refused(config):
    with pytest.raises(ValueError) as error:
        follow(config)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.onnx", b"no network at all " * 50, "Failed to parse ONNX model"),
        ("a.onnx", None, "No such file or directory"),
        (".", None, "cannot read this model: it is a folder"),
    ],
)
@pytest.mark.parametrize("kind", cv2_tracker.MODELS)
def test_a_model_that_is_none_is_named(kind, name, content, reason, tmp_path, capfd):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    said = refused(Config(name=kind, model=(str(path),) * len(cv2_tracker.MODELS[kind])))
    assert str(path) in said
    assert reason in said
    assert capfd.readouterr() == ("", "")


def test_a_model_of_another_tracker_is_named(vit, tmp_path):
    assert refused(Config(name="Nano", model=(str(vit),) * 2)).startswith(
        f"OpenCV's Nano with {vit}, {vit}: "
    )
    other = tmp_path / "other.onnx"
    relu = tiny_onnx.node("Relu", ["template"], "output1")
    shapes = {"template": (1, 3, 128, 128)}, {"output1": (1, 3, 128, 128)}
    other.write_bytes(tiny_onnx.model([relu], {}, *shapes))
    assert refused(Config(name="Vit", model=str(other))).startswith(f"OpenCV's Vit with {other}: ")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"name": "Vit"},
            "the setting model gives OpenCV's tracker Vit 0 files; their number should be 1 (net)",
        ),
        (
            {"name": "Nano", "model": "a.onnx"},
            "the setting model gives OpenCV's tracker Nano 1 files; their number should be 2 (backbone, neckhead)",
        ),
        (
            {"model": "a.onnx"},
            "the setting model gives OpenCV's tracker MIL 1 files; their number should be 0 (none)",
        ),
        (
            {"least_confidence": 0.3},
            "OpenCV's MIL reports no confidence, but least_confidence = 0.3 needs one: "
            "set least_confidence to 0",
        ),
    ],
)
def test_settings_that_do_not_fit_are_refused(settings, message):
    assert refused(Config(**settings)) == message


@pytest.mark.parametrize("name", ["CSRT", "KCF"])
@pytest.mark.newest
def test_a_tracker_of_the_additional_modules_follows_or_says_where_it_is(name):
    if hasattr(cv2, f"Tracker{name}"):
        assert follow(Config(name=name), count=6)[-1].state.x == pytest.approx(75, abs=4)
    else:
        assert refused(Config(name=name)) == (
            f"OpenCV {cv2.__version__} without the additional modules has no tracker '{name}' "
            "(uninstall every opencv package, then install opencv-contrib-python-headless: "
            "whichever is installed last is used); it "
            "has DaSiamRPN, MIL, Nano, Vit"
        )


def test_what_is_imported_decides_which_opencv_it_is_called(monkeypatch):
    """Two distributions write into one folder: the packages that are installed do not tell."""
    monkeypatch.setattr(cv2, "TrackerCSRT", object(), raising=False)
    assert cv2_tracker.running() == f"{cv2.__version__} with the additional modules"
    monkeypatch.delattr(cv2, "TrackerCSRT")
    assert cv2_tracker.running() == f"{cv2.__version__} without the additional modules"


def test_an_unknown_name_lists_what_there_is():
    assert refused(Config(name="Best")).startswith(
        f"OpenCV {cv2_tracker.running()} has no tracker 'Best'; it has "
    )


class Leaving:
    """What OpenCV does when the box has left the picture."""

    @staticmethod
    def create(*_settings):
        return Leaving()

    def init(self, _image, _rect):
        self.count = 0

    def update(self, _image):
        self.count += 1
        if self.count == self.fails:
            raise cv2.error("roi")
        return True, (50, 40, 30, 20)

    def getTrackingScore(self):
        return 1.0


@pytest.mark.parametrize(("name", "models"), [("MIL", ()), ("Vit", ("net.onnx",))])
def test_what_opencv_refuses_is_unseen_once_the_model_has_worked(
    name, models, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for model in models:
        (tmp_path / model).touch()
    monkeypatch.setattr(cv2, f"Tracker{name}", Leaving)
    config = Config(name=name, model=models)
    Leaving.fails = 2
    assert [e.status.name for e in follow(config, 5)] == ["LOCKED", "UNSURE", "LOCKED", "LOCKED"]
    Leaving.fails = 1
    if models:
        assert refused(config).startswith("OpenCV's Vit with net.onnx: ")
    else:
        assert follow(config)[0].status is Status.UNSURE


def test_an_answer_of_opencv_counts_if_it_has_a_box_and_its_score_is_from_0_to_1(monkeypatch):
    answers = [
        (True, (3, 4, 1, 1)),
        (True, (3, 4, 0, 9)),
        (True, (3, 4, 9, 0)),
        (False, (3, 4, 5, 6)),
    ]
    scores = [0.4, 1.5, -2.0, np.nan]

    class Answering:
        def init(self, image, box):
            return True

        def update(self, image):
            return answers.pop(0)

        def getTrackingScore(self):
            return scores.pop(0)

    monkeypatch.setattr(cv2_tracker, "creator_of", lambda name: Answering)
    tracker = cv2_tracker.Cv2Tracker("MIL", (), 0)
    picture = np.zeros((9, 9, 3), np.uint8)
    assert tracker.init(picture, (1, 1, 5, 1))
    with pytest.raises(
        ValueError, match=r"^the region is 4 x 4 px; OpenCV's MIL needs a side of at"
    ):
        tracker.init(picture, (1, 1, 4, 4))
    found = [tracker.update(picture) for _ in range(4)]
    assert [seen for seen, _ in found] == [True, False, False, False]
    assert found[0][1] == (3, 4, 1, 1)
    assert tracker.update(np.zeros((9, 8, 3), np.uint8)) == (False, ())
    assert [tracker.score() for _ in range(4)] == [0.4, 1.0, 0.0, 0.0]
