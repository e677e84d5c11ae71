"""Colours that mean the same in all drawings: of truth, goal, particles, status and curves."""

from tracking.types import Status

TRUTH = (255, 255, 255)
GOAL = (240, 50, 50)
PARTICLES = (255, 190, 40)
"""Of outlines and dots on pictures (RGB)."""
STATUS = {
    Status.LOCKED: (60, 220, 60),
    Status.UNSURE: (255, 180, 30),
    Status.LOST: (240, 50, 50),
}
"""Of the estimate's outline on pictures (RGB)."""
ESTIMATE = STATUS[Status.LOCKED]
"""Of the estimate's outline where its status is not shown."""
STATUS_ON_WHITE = {"LOCKED": "#1f7a3a", "UNSURE": "#b7791f", "LOST": "#c23b2e"}
"""Darker, for bands and names of the status on white."""
CURVES = ("#c23b2e", "#2b6cb0", "#1f7a3a", "#b7791f", "#7b3fa0", "#159aa0", "#d6559a", "#555555")
"""Of curves on white: as many as the largest of our feature sets has features."""
