"""What several tests need: a renderer of one thread, the shared measurements, a painted picture."""

import json
import os
from contextlib import ExitStack
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")  # before any GL context: tests run side by side

import cv2
import numpy as np
import pytest
from commands import scheduler_with
from hypothesis import HealthCheck, settings

# The same examples in each run: what CI finds anybody finds. The first call compiles: no deadline.
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("SERVOBENCH_DATA", ROOT.parent / "shared" / "data"))


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def servo_data() -> Path:
    folder = DATA / "servo"
    if not folder.is_dir():
        pytest.skip(f"the reference vectors are not on this machine ({folder})")
    return folder


@pytest.fixture(scope="session")
def shared_sequences() -> Path:
    folder = DATA / "sequences"
    if not folder.is_dir():
        pytest.skip(f"the annotated sequences are not on this machine ({folder})")
    return folder


@pytest.fixture(scope="session")
def smooth_image():
    """A colourful random picture (120, 160, 3) without sharp edges."""
    noise = np.random.default_rng(0).normal(128, 90, (120, 160, 3))
    blurred = cv2.GaussianBlur(noise, (0, 0), 3)
    return np.clip((blurred - 128) * 3 + 128, 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """The folder of a real run of half a second that misses one of two bounds; copy it to change
    it.
    """
    from servo import commands

    folder = tmp_path_factory.mktemp("run") / "out"
    changes = ["run.duration=0.5", "expect={}", "expect.tilt_peak_deg=1.0",
               "expect.servo_rms_px=0.5", "tracker.kind=mean_shift"]  # fmt: skip
    assert commands.run_scenario("still", changes, 3, folder, quiet=True, rerun=True) == 1
    return folder


@pytest.fixture(scope="session")
def make_papers():
    """Writes what `servobench papers` leaves, with two claims and a figure, into a folder."""

    def make(folder):
        (folder / "figures").mkdir(parents=True)
        told = {"says": "it is so", "measured": "1 & 2", "table": [["x"], ["7"]]}
        told |= {"figures": ["figures/one.png"]}
        claims = {"P0-1": told | {"holds": True}, "P2-2": told | {"holds": False}}
        text = json.dumps({"version": "0.1.0", "quick": True, "claims": claims})
        (folder / "papers.json").write_text(text)
        cv2.imwrite(str(folder / "figures" / "one.png"), np.zeros((30, 60, 3), np.uint8))
        return folder

    return make


@pytest.fixture
def cluster():
    """Starts a scheduler with workers; gives their processes, the scheduler first, and its
    address.
    """
    with ExitStack() as started:
        yield lambda *options, **more: started.enter_context(scheduler_with(*options, **more))
