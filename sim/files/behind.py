"""The files behind a file: those that it names, and those that these name.

MJCF and URDF name meshes, pictures and other models; OBJ names materials, and these name pictures;
ONNX names files with weights. A name is looked for in more folders than a reader would look in: a
file too many does no harm, and one that is missed leaves old results in place of new ones.
"""

import functools
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from xml.etree import ElementTree

ADDRESS = re.compile("^[a-z]+://")
"""How URDF begins the name of a file, other than with its path."""
PACKAGE = re.compile("^[^/]*/+")
"""A package's name, in front of a path in it."""
LOCATION = re.compile(rb"\n\x08location\x12")
"""An entry of `TensorProto.external_data` in ONNX up to its value: fields 1 and 2 of the message,
both of bytes. It is found in any graph, at any depth."""


def files_behind(path: Path) -> set[Path]:
    """Return a file and all that it refers to, of what exists.

    Raises:
        OSError: A file cannot be read.
    """
    found = {path}
    folders = {path.parent, *path.resolve().parents}
    names = set[str]()
    waiting = {path}
    while waiting:
        for file in waiting:
            named, below = _named(file, file.stat().st_mtime_ns, file.stat().st_size)
            names |= named
            folders |= {file.parent / folder for folder in ("", *below)}
            folders |= {path.parent / folder for folder in below}  # of an included model
        places = (folder / name for folder in folders for name in names)
        waiting = (
            {place.resolve() for place in places if _is_file(place)} - found - {path.resolve()}
        )
        found |= waiting
    return found


def _is_file(path: Path) -> bool:
    return os.path.isfile(path)  # noqa: PTH113 (Path's raises for a name that no file can have)


@functools.lru_cache(maxsize=1024)  # each run of a study asks again
def _named(path: Path, changed: int, size: int) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of files in a file that has this size and was changed then [ns], and the
    folders that it names.
    """
    del changed, size
    match path.suffix.lower():
        case ".xml" | ".urdf" | ".dae":
            return _in_xml(path.read_bytes())
        case ".obj":
            lines = (words for words in _lines(path) if words[0] == "mtllib")
        case ".mtl":
            lines = _lines(path)
        case ".onnx":
            return frozenset(_locations(path.read_bytes())), frozenset()
        case _:
            lines = ()
    return frozenset(_ends(lines)), frozenset()


def _in_xml(content: bytes) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of files and of folders in a model; none where it is no XML."""
    try:
        elements = list(ElementTree.fromstring(content).iter())
    except (ElementTree.ParseError, ValueError, LookupError):  # also of an unknown encoding
        return frozenset(), frozenset()
    every = [pair for element in elements for pair in element.items()]
    names = {value for key, value in every if key.startswith("file")}
    names |= {e.text.strip() for e in elements if e.text and e.tag.endswith("init_from")}  # Collada
    paths = {ADDRESS.sub("", name) for name in names}
    inside = {PACKAGE.sub("", path) for path in paths if path not in names}
    bare = {Path(name).name for name in names}  # strippath="true"
    return frozenset(paths | inside | bare), frozenset(v for key, v in every if key.endswith("dir"))


def _lines(path: Path) -> Iterator[list[str]]:
    """Yield the words of each line that has some."""
    with path.open(encoding="utf-8", errors="surrogateescape") as file:
        yield from filter(None, (line.split() for line in file))


def _ends(lines: Iterable[list[str]]) -> Iterator[str]:
    """Yield each word of lines but the first, and each rest of a line: names may have spaces, and
    options stand before them.
    """
    for _, *words in lines:
        for i, word in enumerate(words):
            yield word.replace("\\", "/")
            yield " ".join(words[i:]).replace("\\", "/")


def _locations(content: bytes) -> Iterator[str]:
    """Yield the names of files with the weights of a network."""
    for entry in LOCATION.finditer(content):
        size = 0
        for shift, byte in enumerate(content[entry.end() : entry.end() + 4]):  # a varint
            size |= (byte & 0x7F) << 7 * shift
            if byte < 0x80:
                begin = entry.end() + shift + 1
                yield content[begin : begin + size].decode("utf-8", "surrogateescape")
                break
