"""Our own robots: models with their own camera and velocity drives, their base at the origin."""

from dataclasses import replace

import numpy as np

from sim.robot.design import Design, Drives, Inversion
from sim.robots import mjcf


def shipped(
    model: str, drives: Drives, homes: tuple[tuple[float, ...], ...], inversion: Inversion
) -> Design:
    """Return the design of a shipped model, such as "arm.xml"."""
    config = mjcf.Config(model=model, base=(0.0, 0.0, 0.0, 0.0), camera="eye", home=homes)
    design = config.build(np.random.default_rng(0))  # it draws nothing
    return replace(design, drives=drives, inversion=inversion)
