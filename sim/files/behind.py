"""The search for all files that a file refers to, directly or through other files.

MJCF and URDF name meshes, pictures and other models; OBJ names materials, and these name pictures;
ONNX names files with weights. Names are looked for in more folders than a program that reads the
file would search: an extra file does no harm, but if one were missed, results computed before it
changed would be taken for new ones.
"""

import functools
import re
from collections.abc import Iterator
from pathlib import Path, PurePath
from xml.etree import ElementTree

from sim.files.packages import folders_above, is_file, package_folder, parted

NAMES = {
    ".obj": re.compile(rb"^\W*mtllib\s+(.+)$", re.IGNORECASE | re.MULTILINE),
    ".mtl": re.compile(rb"^\s*\w+\s+(.+)$", re.MULTILINE),
    ".gltf": re.compile(rb'"uri"\s*:\s*"([^":]*)"'),
    ".glb": re.compile(rb'"uri"\s*:\s*"([^":]*)"'),
}
"""Patterns of the texts that name files, by the suffix of the file in which they are. In glTF,
texts with a colon are left out, as they are contents, which begin with "data:"."""
COLLADA = ("init_from", "ref")
"""Ends of the names of those elements of Collada that contain the name of a picture."""
BEGIN = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"
"""Bytes that may stand before the first element of XML."""
LOCATION = re.compile(rb"\n\x08location\x12([\x80-\xff]{0,3}[\x00-\x7f])")
"""An entry of `TensorProto.external_data` in ONNX up to the length of its value, a varint: fields 1
and 2 of the message, both of bytes. It is found in any graph, at any depth."""


def files_behind(path: Path) -> set[Path]:
    """Return the path of a file, and the resolved paths of all existing files that it refers to,
    directly or through others: those that an MJCF, URDF, Collada, OBJ, MTL, glTF or ONNX file
    names. Files of the same names in other folders that are searched may be among them.

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
    """Return the names of files and the names of folders that a file contains.

    Args:
        path: The file.
        changed: Time of its last change [ns]; with the size, it tells whether the cache is valid.
        size: Its size [bytes].
    """
    del changed, size
    suffix = path.suffix.lower()
    if suffix in NAMES:
        texts = NAMES[suffix].findall(path.read_bytes())
        return frozenset(end for text in texts for end in _ends(_decoded(text))), frozenset()
    if suffix == ".onnx":
        return frozenset(_locations(path.read_bytes())), frozenset()
    return _in_xml(path)


def _in_xml(path: Path) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of files and the names of folders that an XML file (MJCF, URDF or Collada)
    contains; two empty sets if the file is not XML.
    """
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


def _ends(text: str) -> Iterator[str]:
    """Yield each word of a text, and the text from each word on: names may have spaces, and options
    stand before them.
    """
    words = text.split()
    for i, word in enumerate(words):
        yield word
        yield " ".join(words[i:])


def _locations(content: bytes) -> Iterator[str]:
    """Yield the names of the files in which an ONNX file, given by its bytes, keeps the weights of
    its network.
    """
    for entry in LOCATION.finditer(content):
        size = sum((byte & 0x7F) << 7 * place for place, byte in enumerate(entry[1]))
        yield _decoded(content[entry.end() : entry.end() + size])


def _decoded(name: bytes) -> str:
    return name.decode("utf-8", "surrogateescape")
