"""Runs, tracks and films close what they write, and a fault of closing hides no other."""

from functools import partial

import cv2
import numpy as np
import pytest
import tiny_onnx
from click.testing import CliRunner
from tiny_onnx import node

from servo.cli import run_command
from servo.cli.main import app
from servo.closing import closing
from servo.loop.part_failures import PartFailed
from servo.mistake import Mistake
from servo.output.film import RunFilm
from servo.output.mcap_file import RunMcap
from servo.output.recording.log import RerunLog
from servo.output.run_folder import with_traceback
from servo.output.steps_table import StepsTable
from tracking.drawing.annotated_video import AnnotatedVideo
from tracking.evaluation.track_file import TrackFile

SHORT = ["run.duration=0.2", "tracker.kind=frozen", "estimator.kind=none", "expect={}"]
LAWS = """
import numpy as np
from servo import Command

def four(seen, task):
    return np.zeros(4)

def nan(seen, task):
    return np.full(6, np.nan)

def raises(seen, task):
    raise RuntimeError("no weights")

class Later:
    left = 3

    def start(self, task):
        pass

    def command(self, seen, posture, dt):
        self.left -= 1
        if self.left == 0:
            raise RuntimeError("no weights")
        return Command(np.zeros(6))
"""
SIX = "it should be a NumPy array of six finite numbers (vx, vy, vz, wx, wy, wz)"


@pytest.fixture
def fail(tmp_path, monkeypatch):
    """Run a scenario whose law fails; the sentence, and the files that are left."""
    (tmp_path / "laws_that_fail.py").write_text(LAWS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)

    def run(*law):
        files = {"video": tmp_path / "a.mp4", "mcap": tmp_path / "a.mcap"}
        changes = [*SHORT, *law]
        with pytest.raises(Mistake) as failed:
            run_command.run("still", changes, None, tmp_path / "out", quiet=True, **files)
        left = {path.name for path in (*tmp_path.glob("a.*"), *(tmp_path / "out").iterdir())}
        return str(failed.value).replace(f"{tmp_path}/", ""), left

    return run


@pytest.mark.parametrize(
    ("law", "sentence", "left"),
    [
        ("four", f"Command.twist is [0. 0. 0. 0.]; {SIX}", set()),
        ("nan", f"Command.twist is [nan nan nan nan nan nan]; {SIX}", set()),
        (
            "raises",
            "RuntimeError: no weights; its traceback is in out/traceback.txt",
            {"traceback.txt"},
        ),
    ],
)
def test_a_law_that_fails_at_once_is_one_sentence_and_leaves_nothing_empty(
    fail, law, sentence, left
):
    law = f"laws_that_fail:{law}"
    assert fail(f"controller.kind={law}") == (f"controller '{law}': {sentence}", left)


def test_so_is_a_network(fail, tmp_path):
    weights = {"w": np.full((6, 6), np.nan)}
    shapes = {"joints": (1, 6)}, {"twist": (1, 6)}
    made = tiny_onnx.model([node("MatMul", ["joints", "w"], "twist")], weights, *shapes)
    (tmp_path / "nan.onnx").write_bytes(made)
    sentence, left = fail("controller.kind=onnx", "controller.file=nan.onnx")
    assert sentence == f"controller 'onnx': Command.twist is [nan nan nan nan nan nan]; {SIX}"
    assert left == set()


def broken(close):
    def closes(self):
        close(self)
        raise RuntimeError("closing")

    return closes


@pytest.mark.parametrize("closer", [RerunLog, RunMcap, RunFilm, StepsTable])
def test_a_recording_that_cannot_be_closed_hides_no_failure_of_a_law(fail, monkeypatch, closer):
    monkeypatch.setattr(closer, "close", broken(closer.close))
    sentence, left = fail("controller.kind=laws_that_fail:Later")
    assert sentence == (
        "controller 'laws_that_fail:Later': RuntimeError: no weights; its traceback is in "
        "out/traceback.txt"
    )
    assert left == {"a.mp4", "a.mcap", "run.rrd", "steps.parquet", "traceback.txt"}


class FailsLater:
    """A tracker that fails in the third picture."""

    def init(self, image, rect):
        self.rect = rect
        self.left = 2

    def update(self, image):
        self.left -= 1
        return bool(1 // self.left), self.rect


@pytest.mark.parametrize("closer", [TrackFile, AnnotatedVideo])
def test_nor_of_a_tracker(tmp_path, monkeypatch, closer):
    for k in range(5):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.full((60, 80, 3), 40 * k, np.uint8))

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(closer, "close", broken(closer.close))
    words = f"track . --region 20,20,20,20 --tracker {__name__}:FailsLater --video a.mp4 -q --out o"
    result = CliRunner().invoke(app, words.split())
    assert isinstance(result.exception, Mistake)
    assert str(result.exception).endswith(
        ":FailsLater': ZeroDivisionError: integer division or modulo by zero; its traceback is in "
        "o/traceback.txt"
    )


def test_all_are_closed_and_the_first_failure_counts():
    closed = []

    def failing(name):
        closed.append(name)
        raise OSError(name)

    with pytest.raises(KeyError, match="block"), closing(*(partial(failing, k) for k in "ab")):
        raise KeyError("block")
    with pytest.raises(OSError, match="a"), closing(*(partial(failing, k) for k in "ab")):
        pass
    assert closed == ["a", "b", "a", "b"]


def test_a_traceback_that_cannot_be_written_hides_nothing(tmp_path):
    (tmp_path / "file").touch()
    failed = PartFailed("the law failed")
    failed.__cause__ = RuntimeError("no weights")
    assert with_traceback(failed, tmp_path / "file") is failed
