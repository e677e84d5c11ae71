"""Models of others, MJCF or URDF, read as data: no file outside their own folder is opened, and
models that are too large are refused before they are loaded.
"""

import re
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from sim.files import reading
from sim.models.model_assets import Assets, package_root
from sim.models.urdf import complete_urdf
from sim.quiet import silent_libraries

MOST_TEXT = 5_000_000
DEEPEST = 200
"""Limits of a file of XML: its size [bytes], and its elements inside each other."""
MULTIPLIED = (
    "replicate",
    "composite",
    "flexcomp",
    "flex",
    "skin",
    "plugin",
    "model",
    "attach",
    "hfield",
)
"""Elements that are refused: they read other files, or become very many elements."""
NOT_TAKEN = ("size", "visual", "statistic", "option", "custom", "sensor", "contact", "extension")
"""Sections that are left out: they describe a whole simulation, or collisions, which do not matter
here.
"""
NUMBERED = re.compile(r"( Element name '(?P<name>[^']*)', id \d+)|,? line \d+")
"""What MuJoCo's messages say of places: lines are of the text after includes."""
SOLID = (
    "body_pos",
    "body_quat",
    "body_mass",
    "body_inertia",
    "geom_pos",
    "geom_size",
    "jnt_pos",
    "jnt_axis",
    "mesh_vert",
)
"""Arrays of a compiled model in which all numbers have to be finite."""


def read_spec(path: Path, what: str) -> mujoco.MjSpec:
    """The model in an MJCF or URDF file, which compiles as it is; its assets have absolute paths.

    Lights, cameras and keyframes are left in it; options, sensors and contact pairs are not.

    Args:
        path: Where it is.
        what: What it should be, for messages: "robot".

    Raises:
        ValueError: It is broken, incomplete, too large, or reaches out of its folder; the sentence
            begins with the file's name.
    """
    return spec_of(read_tree(path, what), path, what)


def spec_of(tree: Element, path: Path, what: str) -> mujoco.MjSpec:
    """The model of the elements that `read_tree` gave for a file.

    Raises:
        ValueError: MuJoCo cannot compile it.
    """
    text = ElementTree.tostring(tree, encoding="unicode")
    try:
        with silent_libraries():
            spec = mujoco.MjSpec.from_string(text)
            model = spec.copy().compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ValueError(_sentence(path, what, said_by_mujoco(error))) from None
    for name in SOLID:
        if not np.isfinite(getattr(model, name)).all():
            raise ValueError(_sentence(path, what, f"a number in its {name} is not finite"))
    return spec


def said_by_mujoco(error: Exception) -> str:
    """A message of MuJoCo's compiler as part of a sentence."""

    def place(found: re.Match[str]) -> str:
        return f" ('{found['name']}')" if found["name"] else ""

    said = NUMBERED.sub(place, " ".join(str(error).split()))
    return said.removeprefix("XML ").removeprefix("Error: ")


def read_tree(path: Path, what: str) -> Element:
    """The elements of a model: includes are expanded, and files are named by absolute paths.

    Raises:
        ValueError: As for `read_spec`, but for what only MuJoCo sees.
    """
    return _read(path, what)[0]


def files_of(path: Path) -> set[Path]:
    """The files that a model consists of, itself included; only itself where it cannot be read."""
    try:
        return _read(path, "model")[1].seen
    except ValueError:
        return {path}


def _read(path: Path, what: str) -> tuple[Element, Assets]:
    reading.opened(path, what).close()  # refused with its reason, if it is no file
    try:
        root = package_root(path) if path.suffix.lower() == ".urdf" else path.parent.resolve()
        assets = Assets(root)
        tree = _parsed(assets.start(path))
        match tree.tag:
            case "mujoco":
                _expand_includes(tree, assets, path.parent.resolve())
                _check_mjcf(tree, assets, path.parent.resolve())
            case "robot":
                complete_urdf(tree, assets, path.parent.resolve())
            case _:
                raise ValueError(
                    f"its root is <{tree.tag}>; it should be <mujoco> (MJCF) or <robot> (URDF)"
                )
        _check_numbers(tree)
    except ValueError as error:
        raise ValueError(_sentence(path, what, str(error))) from None
    return tree, assets


def _check_numbers(tree: Element) -> None:
    """Refuse what MuJoCo would take for no limit, or for a small mass."""
    for element in tree.iter():
        for key, value in element.attrib.items():
            if key != "name" and "nan" in value.lower().split():
                raise ValueError(f"its <{element.tag}> has {key} = '{value}', which is no number")


def _sentence(path: Path, what: str, reason: str) -> str:
    return f"{path}: cannot read this {what}: {reason}"


class _Careful(ElementTree.TreeBuilder):
    """Elements of a file, refused where they lie too deep, and without a document type, whose
    entities might be anything.
    """

    depth = 0

    def doctype(self, *_: Any) -> NoReturn:
        raise ValueError("has a document type (DTD); its entities are not expanded")

    def start(self, *given: Any) -> Element:
        self.depth += 1
        if self.depth > DEEPEST:
            raise ValueError(
                f"has elements that lie too deep in each other; the limit is {DEEPEST}"
            )
        return super().start(*given)

    def end(self, tag: str) -> Element:
        self.depth -= 1
        return super().end(tag)


def _parsed(path: Path) -> Element:
    """The elements of a file of XML."""
    if path.stat().st_size > MOST_TEXT:
        raise ValueError(f"'{path.name}' is too large for XML; the limit is {MOST_TEXT:,} bytes")
    try:
        parser = ElementTree.XMLParser(target=_Careful())
        return ElementTree.fromstring(path.read_bytes(), parser)
    except (ElementTree.ParseError, LookupError) as error:
        raise ValueError(f"'{path.name}' is no XML: {error}") from None
    except ValueError as error:
        raise ValueError(f"'{path.name}' {error}") from None


def _expand_includes(tree: Element, assets: Assets, folder: Path) -> None:
    """Put the elements of included files where the includes are; each file may come once."""
    for parent in list(tree.iter()):
        for i, child in reversed(list(enumerate(parent))):
            if child.tag != "include":
                continue
            name = child.get("file", "")
            before = len(assets.seen)
            path = assets.find(name, folder)
            if len(assets.seen) == before:
                raise ValueError(f"'{name}' is included twice, or includes itself")
            included = _parsed(path)
            _expand_includes(included, assets, folder)
            parent[i : i + 1] = list(included)


def _check_mjcf(tree: Element, assets: Assets, folder: Path) -> None:
    for section in [child for child in tree if child.tag in NOT_TAKEN]:
        tree.remove(section)
    meshes, textures, bare = _folders(tree, folder)
    for element in tree.iter():
        if element.tag in MULTIPLIED:
            raise ValueError(f"it has a <{element.tag}>, which is not read from models of others")
        for key in [key for key in element.attrib if key.startswith("file")]:
            name = element.get(key, "")
            name = Path(name).name if bare else name
            if element.tag not in ("mesh", "texture"):
                raise ValueError(f"it has a <{element.tag}> with a file")
            path = assets.find(name, meshes if element.tag == "mesh" else textures)
            element.set(key, str(path))
            (assets.add_mesh if element.tag == "mesh" else assets.add_picture)(path)
        _check_made(element, assets)


def _folders(tree: Element, folder: Path) -> tuple[Path, Path, bool]:
    """Where meshes and textures are, and whether only the last parts of their names count; this is
    taken out of the tree, as all paths become absolute.
    """
    given: dict[str, str] = {}
    for compiler in tree.findall("compiler"):
        for key in ("assetdir", "meshdir", "texturedir", "strippath"):
            if (value := compiler.attrib.pop(key, None)) is not None:
                given[key] = value
    both = given.get("assetdir", "")
    meshes, textures = (folder / given.get(key, both) for key in ("meshdir", "texturedir"))
    return meshes, textures, given.get("strippath") == "true"


def _check_made(element: Element, assets: Assets) -> None:
    """Count what MuJoCo makes itself."""
    element.attrib.pop("content_type", None)
    if "builtin" not in element.attrib:
        return
    if element.tag == "mesh":
        raise ValueError("it has a <mesh> with builtin, which is not read from models of others")
    try:
        width, height = (int(element.get(key, "0")) for key in ("width", "height"))
    except ValueError:
        return  # MuJoCo says what is wrong
    pixels = abs(width * height)
    if element.get("type", "cube") in ("cube", "skybox"):  # six sides, which MuJoCo makes square
        pixels = 6 * max(abs(width), abs(height)) ** 2
    assets.add_pixels(pixels, element.get("name", "a texture"))
