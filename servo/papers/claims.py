"""All claims, and where their verdicts are written."""

from __future__ import annotations

from servo.papers import estimator_study, kams_paper, kernel_paper, servo_paper, texture_paper

CLAIMS = (
    *kams_paper.CLAIMS, *kernel_paper.CLAIMS, *servo_paper.CLAIMS, *texture_paper.CLAIMS,
    *estimator_study.CLAIMS,
)  # fmt: skip
JOINED = "P0-1"
"""The claim that real sequences join."""
FIGURES, SUMMARY = "figures", "papers.json"
