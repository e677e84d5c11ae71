"""What several tests need: a renderer of one thread, the shared measurements, a painted picture."""

import os
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")  # before any GL context: tests run side by side

import cv2
import numpy as np
import pytest
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
