"""The versions that decide the numbers."""

from __future__ import annotations

from importlib import metadata

VERSIONED = (
    "servobench",
    "mujoco",
    "numpy",
    "numba",
    "opencv-python-headless",
    "filterpy",
    "rerun-sdk",
)


def versions() -> dict[str, str]:
    """Version by package."""
    return {name: metadata.version(name) for name in VERSIONED}
