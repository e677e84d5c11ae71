"""Client for a tracker in another process that reads and writes lines of JSON.

The program gets a line of JSON, and after a line with a width and a height the picture as raw bytes
(height x width x 3, red, green, blue); it answers each line with a line of its own:

| it gets | it answers |
|---|---|
| {"seed": 7} | {}, or {"gives": ["size"]}, when it has loaded what it needs |
| {"width": 320, "height": 240, "index": 0, "time": 0.0, "box": [130, 105, 60, 30], "angle": 0.0, \
"corners": [[130, 105], ...]} and the first picture | {} |
| {"width": 320, "height": 240, "index": 1, "time": 0.033} and the next picture | {"box": [left, \
top, width, height]}, or other keys of `tracking.guests.report.KEYS` |

The end of its input asks it to end. {"error": "..."} ends the run with that sentence. Lines that do
not begin with "{" are the program's own output.
"""

from typing import final

from sim.types import Frame
from tracking.guests.boxes import exact_box
from tracking.guests.json_lines import JsonLines, Line
from tracking.guests.report import Gives, Report, gives_in, report_in
from tracking.types import Region, State


@final
class ProgramClient:
    """Connection to a tracker that is a program and speaks lines of JSON; the program is ended when
    this object is deleted. `seed` is that of its random numbers, `loading` the longest wait for its
    first answer, and `timeout` for each later one [s].
    """

    cuts = True
    """The tracker is shown the box around the region cut off at the picture's border."""

    def __init__(self, command: str, seed: int, timeout: float, loading: float) -> None:
        """Start a program and wait until it is ready.

        Args:
            command: The program and its arguments, quoted as in a shell; no shell runs it.
            seed: Seed for the program's random numbers.
            timeout: Longest wait for the answer to a picture [s].
            loading: Longest wait for the first answer [s].

        Raises:
            ValueError: The program does not start, sends no line of JSON, reports an error, or
                declares that it gives something unknown.
        """
        self._program = JsonLines(command, seed, timeout, loading)
        gives = self._program.ready.get("gives")
        self.gives: frozenset[Gives] | None = gives_in(gives, self._program.name)
        """What the program's first answer declares that it measures; None: it declares nothing."""

    def start(self, frame: Frame, region: Region, state: State) -> None:
        """Send the first picture, in which the target is the rectangle `region` [px] at `state`,
        and wait for the program's answer.

        Raises:
            ValueError: The program has ended, does not answer in time, or refuses the region.
        """
        target = {
            "box": exact_box(region, state, frame.image).tolist(),
            "angle": state.theta,
            "corners": region.corners(state).tolist(),
        }
        self._show(frame, target)

    def update(self, frame: Frame) -> Report:
        """Send the next picture, and return the program's report: whether it sees the target, and
        where [px].

        Raises:
            ValueError: The program has ended, does not answer in time, reports an error, or its
                answer is not a report.
        """
        answer = self._show(frame, {})
        try:
            return report_in(answer, self._program.name)
        except ValueError:
            self._program.end()
            raise

    def _show(self, frame: Frame, more: Line) -> Line:
        """Send a line with a picture's size, number and time and the keys of `more`, then the
        picture; return the program's answer.
        """
        return self._program.show(frame.image, {"index": frame.index, "time": frame.time, **more})
