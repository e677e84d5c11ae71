"""Count the statements of each room: python tests/tools/statements.py [FOLDER].

Docstrings do not count; an assignment to several names at once counts once a name.
"""

import ast
import sys
from collections import Counter
from pathlib import Path

PACKAGES = "sim", "tracking", "servo"


def is_docstring(node: ast.stmt) -> bool:
    """Return whether a statement is a text alone."""
    is_constant = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return is_constant and isinstance(node.value.value, str)


def weight(node: ast.stmt) -> int:
    """Return for how many statements one counts."""
    if is_docstring(node):
        return 0
    packed = isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)
    if packed and isinstance(node.targets[0], ast.Tuple):
        return len(node.targets[0].elts)
    return 1


def statements(path: Path) -> int:
    """Return the number of statements of a file."""
    tree = ast.parse(path.read_text())
    return sum(weight(node) for node in ast.walk(tree) if isinstance(node, ast.stmt))


def main(root: Path) -> None:
    """Print the rooms of a checkout, the largest first, and their sum."""
    rooms = Counter[str]()
    for package in PACKAGES:
        for path in (root / package).rglob("*.py"):
            room = path.parent.relative_to(root)
            rooms["/".join(room.parts[:2])] += statements(path)
    for room, count in rooms.most_common():
        sys.stdout.write(f"{count:6} {room}\n")
    sys.stdout.write(f"{rooms.total():6} in all\n")


if __name__ == "__main__":
    main(Path(*sys.argv[1:2]))
