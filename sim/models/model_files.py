"""Compilation of MuJoCo models, and removal of their sensors, lights and other extras."""

import warnings
from collections.abc import Iterable

import mujoco

SIMULATION = (
    "keys",
    "sensors",
    "tendons",
    "equalities",
    "excludes",
    "pairs",
    "lights",
)
"""Parts of a model that describe a whole simulation, in an order in which none refers to one that
is gone."""


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Return the compiled model of a MuJoCo specification; warnings of MuJoCo are ignored, and its
    log is switched off.

    MuJoCo warns where the options of an attached model differ from those of the room, which are
    used.

    Raises:
        ValueError: MuJoCo refuses the model.
    """
    keep_no_log()
    with warnings.catch_warnings(action="ignore"):
        return spec.compile()


def said_by_mujoco(error: Exception) -> str:
    """Return the message of an error from MuJoCo's compiler on one line, without "Error:" or "XML
    Error:" at its beginning, to be part of a sentence.
    """
    lines = (line for line in str(error).splitlines() if line)
    return ", ".join(lines).removeprefix("XML Error: ").removeprefix("Error: ")


def leave_out(spec: mujoco.MjSpec, parts: Iterable[str]) -> None:
    """Delete elements of a model, in place: all elements of the lists that `parts` names, such as
    "sensors", and sky textures that no material uses. Other sky textures become cube textures.
    """
    named = {name for material in spec.materials for name in material.textures}
    skies = [t for t in spec.textures if t.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]
    for sky in skies:
        if sky.name in named:
            sky.type = mujoco.mjtTexture.mjTEXTURE_CUBE  # of the same six pictures
    gone = [sky for sky in skies if sky.name not in named]
    for element in [*(element for part in parts for element in getattr(spec, part)), *gone]:
        spec.delete(element)


def keep_no_log() -> None:
    """Stop MuJoCo, in this process, from writing the file MUJOCO_LOG.TXT into the working directory
    and messages to the terminal.
    """
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    config.set()
