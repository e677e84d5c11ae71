"""Types that several settings share: file names, and numbers with the range in which a run is
possible.
"""

from typing import Annotated

from annotated_types import Ge, Le


class NamesFile:
    """Marker in the `Annotated` type of a setting: the setting's text is the name of a file."""


File = Annotated[str, NamesFile()]
"""A file's name, relative to the scenario that names it, else to the working directory. A study
identifies the file by its content, too."""


class NamesFolder(NamesFile):
    """Marker in the `Annotated` type of a setting: the setting's text is the name of a file or a
    folder.
    """


FileOrFolder = Annotated[str, NamesFolder()]
"""The name of a file or a folder; as for `File`."""
LONGEST = 3600.0
"""The longest run [s]: nothing in it can begin later or last longer."""

Time = Annotated[float, Ge(0), Le(LONGEST)]
"""A time in a run, or a duration that may be zero [s]."""
Interval = Annotated[float, Ge(0.001), Le(LONGEST)]
"""A duration that cannot be zero [s]."""
Place = Annotated[float, Ge(-5), Le(5)]
"""A coordinate on the table [m]."""
Length = Annotated[float, Ge(0.001), Le(5)]
"""A length on the table [m]."""
Speed = Annotated[float, Ge(-5), Le(5)]
"""A speed on the table [m/s]; below zero is backwards."""
Share = Annotated[float, Ge(0), Le(1)]
"""A share of a whole, or a factor of at most 1."""
Degrees = Annotated[float, Ge(-3600), Le(3600)]
"""An angle [deg]: ten turns are enough, and their sine still means something."""
Offset = Annotated[float, Ge(-10), Le(10)]
EachJoint = Offset | tuple[Offset, ...]
"""A shift of joints, one for all or one each [m or rad]."""
Play = Annotated[float, Ge(0), Le(1)]
EachPlay = Play | tuple[Play, ...]
"""The play of joints, one for all or one each [m or rad]."""
Acceleration = Annotated[float, Ge(0.01), Le(1e4)]
EachAcceleration = Acceleration | tuple[Acceleration, ...]
"""The largest acceleration of joints, one for all or one each [m/s^2 or rad/s^2]."""


def check(*rules: tuple[bool, str]) -> None:
    """Check several rules about settings, such as that two of them exclude each other.

    Args:
        *rules: Pairs of a condition and a sentence; the rule is broken if the condition is true.

    Raises:
        ValueError: A rule is broken; the message is the sentence of the first broken one.
    """
    for is_broken, sentence in rules:
        if is_broken:
            raise ValueError(sentence)
