"""Colours of true outlines, the goal's outline, particles, status and curves, the same in all
drawings.
"""

from tracking.types import Status

TRUTH = (255, 255, 255)
"""Colour of the true outline on pictures (RGB)."""
GOAL = (240, 50, 50)
"""Colour of the goal's outline on pictures (RGB)."""
PARTICLES = (255, 190, 40)
"""Colour of particles on pictures (RGB)."""
STATUS = {
    Status.LOCKED: (60, 220, 60),
    Status.UNSURE: (255, 180, 30),
    Status.LOST: (240, 50, 50),
}
"""Colour of the estimate's outline on pictures (RGB), by its status."""
ESTIMATE = STATUS[Status.LOCKED]
"""Colour of the estimate's outline where the status is not shown (RGB)."""
STATUS_ON_WHITE = {"LOCKED": "#1f7a3a", "UNSURE": "#b7791f", "LOST": "#c23b2e", "": "#ffffff"}
"""Darker colours of the status for bands and text on white; white for a frame without a status."""
CURVES = ("#c23b2e", "#2b6cb0", "#1f7a3a", "#b7791f", "#7b3fa0", "#159aa0", "#d6559a", "#555555")
"""Colours of curves on white; the largest of our feature sets has as many features."""
