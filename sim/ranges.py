"""Types that several settings share: names of files, and ranges in which a run ends normally."""

from typing import Annotated

from annotated_types import Ge, Le


class NamesFile:
    """Marks a type of settings that name a file."""


File = Annotated[str, NamesFile()]
"""A file's name: in a scenario one beside it, else from the working directory; a study knows the
file by what is in it, too."""
LONGEST = 3600.0
"""The longest run [s]: nothing in it can begin later or last longer."""

Time = Annotated[float, Ge(0), Le(LONGEST)]
"""A moment of a run, or how long something lasts that may last no time at all [s]."""
Interval = Annotated[float, Ge(0.001), Le(LONGEST)]
"""How long something lasts that cannot happen at once [s]."""
Place = Annotated[float, Ge(-5), Le(5)]
"""A coordinate on the table [m]."""
Length = Annotated[float, Ge(0.001), Le(5)]
"""A length on the table [m]."""
Speed = Annotated[float, Ge(-5), Le(5)]
"""Of what drives on the table [m/s]; below zero it drives backwards."""
Share = Annotated[float, Ge(0), Le(1)]
"""A part of a whole, or a factor that takes away."""
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
