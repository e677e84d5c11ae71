"""Counts the places where tests reach private names of the product, by file.

Run `python tests/tools/private_names.py`. A private name begins with one underscore. Modules that begin with one
are not counted: in a folder of kinds they are helpers, which the tests may import.
"""

import ast
import re
import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]
PRIVATE = re.compile(r"_[a-z]\w*[a-z0-9]|_[A-Z]\w*")
PATCHES = {"setattr", "delattr", "patch"}


def is_private(name: str) -> bool:
    """Whether a name is private; `_repr_html_` and its like are the notebook's protocol."""
    return PRIVATE.fullmatch(name) is not None and not name.endswith("_")


def is_set_on_self(node: ast.Attribute) -> bool:
    """Whether an attribute is assigned to the object whose method this is."""
    is_self = isinstance(node.value, ast.Name) and node.value.id == "self"
    return is_self and isinstance(node.ctx, ast.Store)


def own_names(tree: ast.Module) -> set[str]:
    """The private names that this file defines for itself."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Attribute) and is_set_on_self(node):
            found.add(node.attr)
    return found


def names_in(node: ast.AST) -> list[str]:
    """The names that a node reaches in another module or object."""
    match node:
        case ast.ImportFrom():
            folder = TESTS.parent.joinpath(*str(node.module).split("."))
            names = [alias.name for alias in node.names]
            return [name for name in names if not (folder / f"{name}.py").exists()]
        case ast.Attribute():
            return [node.attr]
        case ast.Call(func=ast.Attribute(attr=called)) if called in PATCHES:
            texts = [a.value for a in node.args if isinstance(a, ast.Constant)]
            return [str(text).rsplit(".", 1)[-1] for text in texts]
    return []


def reached(path: Path) -> list[tuple[int, str]]:
    """The lines of a file that reach a private name, with the name."""
    tree = ast.parse(path.read_text())
    own = own_names(tree)
    return [
        (node.lineno, name)
        for node in ast.walk(tree)
        for name in names_in(node)
        if is_private(name) and name not in own
    ]


def main() -> None:
    """Print each place, then the number of places."""
    count = 0
    for path in sorted([*TESTS.glob("*.py"), *TESTS.glob("tools/*.py")]):
        for line, name in sorted(reached(path)):
            count += 1
            sys.stdout.write(f"{path.relative_to(TESTS)}:{line} {name}\n")
    sys.stdout.write(f"{count} places\n")


if __name__ == "__main__":
    main()
