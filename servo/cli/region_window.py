"""A window in which a person draws a region with the mouse: matplotlib's rectangle selector."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from sim.types import Image

if TYPE_CHECKING:
    from servo.cli.region_choice import Box

BACKENDS = ("QtAgg", "TkAgg", "GTK4Agg", "GTK3Agg", "WxAgg", "MacOSX")
HELP = "Drag a rectangle round the target; r: its corners turn it; Enter: track it; Esc: cancel"


def opened(image: Image, name: str) -> Callable[[], Box | None] | None:
    """A function that waits for the person; None where no window can be opened."""
    from matplotlib import pyplot as plt

    for backend in BACKENDS:
        try:
            plt.switch_backend(backend)
            figure = plt.figure(name)
        except Exception:  # each toolkit has exceptions of its own
            continue
        window = RegionWindow(figure, image)

        def wait(window: RegionWindow = window) -> Box | None:
            plt.show()
            plt.switch_backend("agg")  # as before: plots never open a window
            return window.box

        return wait
    plt.switch_backend("agg")
    return None


class RegionWindow:
    """A figure with the picture and a rectangle; `box` is the region after Enter."""

    box: Box | None = None

    def __init__(self, figure: Any, image: Image) -> None:
        from matplotlib.widgets import RectangleSelector

        axes = figure.add_axes((0, 0, 1, 0.94))
        axes.imshow(image, extent=(0, image.shape[1], image.shape[0], 0))
        axes.set_axis_off()
        figure.suptitle(HELP, fontsize=10)
        self._figure = figure
        self.selector = RectangleSelector(
            axes,
            lambda *_: None,
            interactive=True,
            use_data_coordinates=True,
            minspanx=1,
            minspany=1,
        )
        figure.canvas.mpl_connect("key_press_event", self._key)

    def _key(self, event: Any) -> None:
        from matplotlib import pyplot as plt

        if event.key == "enter" and all(side > 0 for side in self._region()[2:4]):
            self.box = self._region()
        if event.key in ("enter", "escape"):
            plt.close(self._figure)

    def _region(self) -> Box:
        """The region of the selector, whose corners follow each other from the top left one."""
        x, y = np.array(self.selector.corners)
        width = np.hypot(x[1] - x[0], y[1] - y[0])
        height = np.hypot(x[3] - x[0], y[3] - y[0])
        turn = np.degrees(np.arctan2(y[1] - y[0], x[1] - x[0]))
        left = x.mean() - width / 2
        top = y.mean() - height / 2
        return (float(left), float(top), float(width), float(height), float(round(turn, 3)))
