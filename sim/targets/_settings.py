"""What the settings of several targets share: rectangle, colours, and files by name."""

import re
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim.models.target import Target, rectangle, target_of
from sim.ranges import Length, Share

Colour = str | tuple[Share, Share, Share]
"""As "#rrggbb", or red, green and blue from 0 to 1."""
HEX = re.compile("#[0-9a-fA-F]{6}")


@dataclass(frozen=True, slots=True)
class Outlined:
    """A target whose reference rectangle is found, or given."""

    outline: tuple[Length, Length, Annotated[float, Ge(0), Le(5)]] | None = None
    """Length along the nose, width, and height over the table of the reference rectangle [m]; by
    default those of the model's site `outline`, or that are found."""

    def target(self, spec: mujoco.MjSpec) -> Target:
        """Return the target of a model.

        Raises:
            ValueError: Nothing of it is seen from above.
        """
        target = target_of(spec)
        if self.outline is None:
            return target
        length, width, height = self.outline
        middle = np.append(target.outline.mean(axis=0)[:2], height)
        return Target(spec, rectangle(middle, length, width))


def rgba(colour: Colour) -> list[float]:
    """A colour as MuJoCo has it.

    Raises:
        ValueError: It is a text, but not "#rrggbb".
    """
    if not isinstance(colour, str):
        return [*colour, 1.0]
    if not HEX.fullmatch(colour):
        raise ValueError(
            f"colour = {colour!r}: a colour is '#rrggbb', or three numbers from 0 to 1"
        )
    return [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] + [1.0]


def file_of(name: str, suffix: str, setting: str) -> Path:
    """A shipped file by its bare name, else a path, which has a suffix.

    Args:
        name: Such as "duck" or "mine/duck.obj".
        suffix: Of the shipped files, such as ".obj".
        setting: What messages call it, such as "file".

    Raises:
        ValueError: No file of that name is shipped.
    """
    if Path(name).suffix:
        return Path(name)
    shipped = {
        f.name.removesuffix(suffix): f
        for f in (resources.files("scenes") / "targets").iterdir()
        if f.name.endswith(suffix)
    }
    if name not in shipped:
        there = ", ".join(sorted(shipped))
        raise ValueError(f"{setting} = {name!r}: this is not shipped; there is {there} (or a path)")
    return Path(str(shipped[name]))
