"""Models of robots and targets in files, MJCF or URDF, read by MuJoCo."""

import warnings
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from sim.files import reading
from sim.models.urdf import PLACE, package_folder, spec_of_urdf

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


def read_spec(path: Path, what: str) -> mujoco.MjSpec:
    """Return the model in an MJCF or URDF file, which compiles as it is.

    Args:
        path: Its file.
        what: The kind of model, for messages: "robot".

    Raises:
        ValueError: It cannot be read or compiled; the sentence begins with the file's name.
    """
    reading.opened(path, what).close()
    _keep_no_log()
    try:
        urdf = path.suffix.lower() == ".urdf"
        spec = spec_of_urdf(path) if urdf else mujoco.MjSpec.from_file(str(path.resolve()))
        compiled(spec.copy())
    except (ValueError, ElementTree.ParseError, mujoco.FatalError) as error:
        raise ValueError(f"{path}: cannot read this {what}: {said_by_mujoco(error)}") from None
    return spec


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a model; what MuJoCo only warns of is left alone.

    It warns where the options of an attached model differ from those of the room, which hold.
    """
    _keep_no_log()
    with warnings.catch_warnings(action="ignore"):
        return spec.compile()


def said_by_mujoco(error: Exception) -> str:
    """Return a message of MuJoCo's compiler as part of a sentence."""
    lines = (line for line in str(error).splitlines() if line)
    return ", ".join(lines).removeprefix("XML Error: ").removeprefix("Error: ")


def leave_out(spec: mujoco.MjSpec, parts: Iterable[str]) -> None:
    """Delete lists of a model's elements, such as "sensors", and its sky."""
    skies = [t for t in spec.textures if t.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]
    for element in [*(element for part in parts for element in getattr(spec, part)), *skies]:
        spec.delete(element)


def files_of(path: Path) -> set[Path]:
    """Return the files that a model consists of, itself included: all that exist of those that it
    names, or that an included model names.
    """
    found = {path}
    folders = {path.parent, package_folder(path)}
    waiting = [path]
    while waiting:
        try:
            elements = list(ElementTree.parse(waiting.pop()).iter())
        except (OSError, ElementTree.ParseError):
            continue
        for element in elements:
            named = (value for key, value in element.items() if key.endswith("dir"))
            folders |= {path.parent / folder for folder in named}
        names = {
            PLACE.sub("", value)
            for element in elements
            for key, value in element.items()
            if key.startswith("file")
        }
        files = {folder / name for folder in folders for name in names}
        new = {file.resolve() for file in files if file.is_file()} - found
        waiting += [file for file in new if file.suffix.lower() == ".xml"]
        found |= new
    return found


def _keep_no_log() -> None:
    """Stop MuJoCo from writing MUJOCO_LOG.TXT into the working directory, and to the terminal."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    config.set()
