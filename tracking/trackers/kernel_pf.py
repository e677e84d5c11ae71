"""Single-kernel particle filter of the multi-kernel paper (Teuliere, Marchand, Eck).

One histogram, four dimensions: orientation is hardly observable, which is why the paper has nine.
"""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from tracking.trackers import mk_pf

PRESETS = {"paper": mk_pf.PRESETS["paper"] | {"density": 48}}


@dataclass(frozen=True, slots=True)
class Config(mk_pf.Config):
    """The multiple-kernel filter's settings with one cell."""

    density: Annotated[int, Ge(1), Le(64)] = 15
    """Points along each side of the template at which a particle reads the image."""
    cells: Annotated[int, Ge(1), Le(8)] = 1
    """Cells along each side: one kernel."""
