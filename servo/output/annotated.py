"""Camera pictures of a run's steps with outlines of the target: truth white, goal red, the estimate
in the colour of its status.
"""

import cv2
from matplotlib import pyplot
from matplotlib.image import AxesImage

from servo.loop.step import Step
from sim.types import Image
from tracking.drawing import colours
from tracking.drawing.contact_sheet import outline

WIDTH = 640
"""Width up to which smaller pictures are enlarged, by a whole number [px]."""
BAND = 24
"""Height of the band with the text [px]."""


def annotated(step: Step) -> Image:
    """Return a copy of a step's picture as RGB (H, W, 3), with outlines of the target and a line of
    text at the top. A small picture is enlarged: by 640 px over its width, rounded to a whole
    number.

    The outlines are the true one (white), the goal (red) and the estimate (in the colour of its
    status). The text gives time [s], status of the tracker, and distance of the true centre from
    the goal [px].
    """
    image = step.frame.image
    factor = max(1, round(WIDTH / image.shape[1]))
    drawn = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    picture: Image = drawn.astype("uint8", copy=False)
    status = step.estimate.status
    outline(picture, step.goal.corners, colours.GOAL, factor)
    outline(picture, step.truth.corners, colours.TRUTH, factor)
    outline(picture, step.estimate.outline(step.region), colours.STATUS[status], factor)
    text = f"{step.frame.time:.2f} s  {status.name}  {step.servo_error:.1f} px"
    cv2.rectangle(picture, (0, 0), (picture.shape[1], BAND), (0, 0, 0), -1)
    cv2.putText(
        picture,
        text,
        (8, BAND - 7),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.5,
        colours.STATUS[status],
        1,
        cv2.LINE_AA,
    )
    return picture


class View:
    """A window of Matplotlib with a title, which shows one picture at a time."""

    def __init__(self, title: str) -> None:
        self.figure = pyplot.figure(title)
        self._axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._axes.set_axis_off()
        self.image: AxesImage | None = None

    def show(self, picture: Image) -> None:
        """Show an RGB picture (H, W, 3) in place of the one before; the first call opens the
        window. All pictures have the same size.
        """
        if self.image is None:
            self.image = self._axes.imshow(picture)
            self.figure.show()
        self.image.set_data(picture)
        self.figure.canvas.draw()
        self.figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window."""
        pyplot.close(self.figure)
