"""The files behind a file: those that it names, and those that these name.

MJCF and URDF name meshes, pictures and other models; OBJ names materials, and these name pictures;
ONNX names files with weights. A name is looked for in more folders than a reader would look in: a
file too many does no harm, and one that is missed leaves old results in place of new ones.
"""

import functools
import re
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePath
from xml.etree import ElementTree

from sim.files.packages import folders_above, is_file, package_folder, parted

URI = re.compile(rb'"uri"\s*:\s*"([^":]*)"')
"""The name of a file in glTF; contents begin with "data:"."""
COLLADA = ("init_from", "ref")
"""Ends of the elements of Collada with the name of a picture."""
BEGIN = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"
"""What may be in front of XML."""
LOCATION = re.compile(rb"\n\x08location\x12")
"""An entry of `TensorProto.external_data` in ONNX up to its value: fields 1 and 2 of the message,
both of bytes. It is found in any graph, at any depth."""


def files_behind(path: Path) -> set[Path]:
    """Return a file and all that it refers to, of what exists.

    Raises:
        OSError: A file cannot be read.
    """
    found = {path}
    folders = {path.parent, *folders_above(path)}
    names = set[str]()
    waiting = {path}
    while waiting:
        for file in waiting:
            named, below = _named(file, file.stat().st_mtime_ns, file.stat().st_size)
            names |= named
            for package, inside in map(parted, named):
                names |= {inside, PurePath(inside).name}  # which readers look for beside the file
                if package:
                    names.add("package.xml")
                    folders |= {package_folder(path, package, inside) or path.parent}
            folders |= {file.parent / folder for folder in ("", *below)}
            folders |= {path.parent / folder for folder in below}  # of an included model
        places = (folder / name for folder in folders for name in names if name)
        waiting = {place.resolve() for place in places if is_file(place)} - found - {path.resolve()}
        found |= waiting
    return found


@functools.lru_cache(maxsize=1024)  # each run of a study asks again
def _named(path: Path, changed: int, size: int) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of files in a file that has this size and was changed then [ns], and the
    folders that it names.
    """
    del changed, size
    match path.suffix.lower():
        case ".obj":
            lines = (words for words in _lines(path) if words[0].lower() == "mtllib")
        case ".mtl":
            lines = _lines(path)
        case ".onnx":
            return frozenset(_locations(path.read_bytes())), frozenset()
        case ".gltf" | ".glb":
            found = URI.findall(path.read_bytes())
            return frozenset(name.decode("utf-8", "surrogateescape") for name in found), frozenset()
        case _:
            return _in_xml(path)
    return frozenset(_ends(lines)), frozenset()


def _in_xml(path: Path) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of files and of folders in a model; none where it is no XML."""
    with path.open("rb") as file:
        if not file.read(64).lstrip(BEGIN).startswith(b"<"):
            return frozenset(), frozenset()
    try:
        elements = list(ElementTree.parse(path).iter())
    except (ElementTree.ParseError, ValueError, LookupError):  # also of an unknown encoding
        return frozenset(), frozenset()
    every = [pair for element in elements for pair in element.items()]
    names = {value for key, value in every if key.startswith("file")}
    names |= {e.text.strip() for e in elements if e.text and e.tag.endswith(COLLADA)}
    return frozenset(names), frozenset(value for key, value in every if key.endswith("dir"))


def _lines(path: Path) -> Iterator[list[str]]:
    """Yield the words of each line that has some."""
    with path.open(encoding="utf-8-sig", errors="surrogateescape") as file:
        yield from filter(None, (line.split() for line in file))


def _ends(lines: Iterable[list[str]]) -> Iterator[str]:
    """Yield each word of lines but the first, and each rest of a line: names may have spaces, and
    options stand before them.
    """
    for _, *words in lines:
        for i, word in enumerate(words):
            yield word
            yield " ".join(words[i:])


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
