"""Every place of a Python file where one operator, comparison, number, truth or result can change.

Not mutated: annotations (and the bounds in `Annotated`), what decorates dataclasses and compiled
functions, strings (docstrings, messages, f-strings), `__all__`, and what runs only under
`TYPE_CHECKING`.
"""

import ast
from dataclasses import dataclass

ARITHMETIC = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "/"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
}
COMPARISON = {
    ast.Lt: ("<", "<=", ">=", ">"),
    ast.LtE: ("<=", "<", ">", ">="),
    ast.Gt: (">", ">=", "<=", "<"),
    ast.GtE: (">=", ">", "<", "<="),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
}
IDENTITY = {ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is")}
KINDS = ("arithmetic", "comparison", "number", "truth", "result")
TYPES_ONLY = {"Annotated", "Literal", "TypeVar", "cast", "Field"}


@dataclass(frozen=True)
class Site:
    """One place, and what may stand there instead."""

    file: str
    kind: str
    start: int
    """Offset in the file's bytes."""
    end: int
    old: str
    new: tuple[str, ...]
    """Alternatives."""
    line: int
    column: int
    """In that line, in bytes."""
    lines: tuple[int, int]
    """First and last line that must run for it to matter."""
    inside: bool
    """In a function's body; else it runs when the file is imported."""


class Finder(ast.NodeVisitor):
    """Collects the sites of one file."""

    def __init__(self, file: str, text: str):
        self.file, self.data = file, text.encode()
        self.starts = [0]
        for line in self.data.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.found: list[Site] = []
        self.inside, self.statement = False, None

    def offset(self, line, column):
        return self.starts[line - 1] + column

    def span(self, node):
        return (
            self.offset(node.lineno, node.col_offset),
            self.offset(node.end_lineno, node.end_col_offset),
        )

    def text(self, start, end):
        return self.data[start:end].decode()

    def add(self, kind, node, start, end, *new):
        old = self.text(start, end)
        first = self.statement.lineno if self.statement else node.lineno
        line = self.data[:start].count(b"\n") + 1
        lines = (first, max(first, node.end_lineno))
        column = start - self.starts[line - 1]
        self.found.append(
            Site(self.file, kind, start, end, old, new, line, column, lines, self.inside)
        )

    def between(self, left, right, sign):
        """Where an operator stands between two operands."""
        start, end = self.span(left)[1], self.span(right)[0]
        at = start + self.text(start, end).encode().index(sign.encode())
        return at, at + len(sign)

    def visit(self, node):
        if isinstance(node, ast.stmt):
            before, self.statement = self.statement, node
            super().visit(node)
            self.statement = before
        else:
            super().visit(node)

    def visit_FunctionDef(self, node):
        for decorator in node.decorator_list:
            if not ast.unparse(decorator).startswith("numba"):
                self.visit(decorator)
        for default in [*node.args.defaults, *(d for d in node.args.kw_defaults if d)]:
            self.visit(default)
        before, self.inside = self.inside, True
        for statement in node.body:
            self.visit(statement)
        self.inside = before

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_ClassDef(self, node):
        for statement in node.body:
            self.visit(statement)

    def visit_AnnAssign(self, node):
        if node.value:
            self.visit(node.value)

    def visit_Assign(self, node):
        if not (isinstance(node.targets[0], ast.Name) and node.targets[0].id == "__all__"):
            self.generic_visit(node)

    def visit_Subscript(self, node):
        if not (isinstance(node.value, ast.Name) and node.value.id in TYPES_ONLY):
            self.generic_visit(node)

    def visit_Call(self, node):
        if not (isinstance(node.func, ast.Name) and node.func.id in TYPES_ONLY):
            self.generic_visit(node)

    def visit_JoinedStr(self, node):
        """Messages; before Python 3.12 their parts have no true offsets."""

    def visit_If(self, node):
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return
        if not isinstance(node.test, ast.Compare):
            start, end = self.span(node.test)
            self.add("truth", node.test, start, end, f"not ({self.text(start, end)})")
        self.generic_visit(node)

    def visit_Return(self, node):
        if node.value and not (isinstance(node.value, ast.Constant) and node.value.value is None):
            start, end = self.span(node.value)
            self.add("result", node.value, start, end, "None")
        self.generic_visit(node)

    def visit_BinOp(self, node):
        signs = ARITHMETIC.get(type(node.op))
        words = (ast.JoinedStr, ast.Constant)
        said = any(
            isinstance(n, words) and isinstance(getattr(n, "value", ""), str)
            for n in (node.left, node.right)
        )
        if signs and not said:
            start, end = self.between(node.left, node.right, signs[0])
            self.add("arithmetic", node, start, end, *signs[1:])
        self.generic_visit(node)

    def visit_AugAssign(self, node):
        signs = ARITHMETIC.get(type(node.op))
        if signs:
            start, end = self.between(node.target, node.value, signs[0] + "=")
            self.add("arithmetic", node, start, end, signs[1] + "=")
        self.generic_visit(node)

    def visit_UnaryOp(self, node):
        start, _ = self.span(node)
        if isinstance(node.op, ast.USub):
            self.add("arithmetic", node, start, start + 1, " ")
        elif isinstance(node.op, ast.Not):
            self.add("truth", node, start, start + 3, "   ")
        self.generic_visit(node)

    def visit_Compare(self, node):
        for left, op, right in zip(
            [node.left, *node.comparators], node.ops, node.comparators, strict=False
        ):
            if signs := COMPARISON.get(type(op)):
                self.add("comparison", node, *self.between(left, right, signs[0]), *signs[1:])
            elif signs := IDENTITY.get(type(op)):
                self.add("truth", node, *self.between(left, right, signs[0]), signs[1])
        self.generic_visit(node)

    def visit_BoolOp(self, node):
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.add("truth", node, *self.between(left, right, old), new)
        self.generic_visit(node)

    def visit_Constant(self, node):
        start, end = self.span(node)
        if isinstance(node.value, bool):
            self.add("truth", node, start, end, str(not node.value))
        elif isinstance(node.value, int):
            self.add("number", node, start, end, str(node.value + 1))
        elif isinstance(node.value, float):
            new = (f"{node.value * 1.5!r}", f"{node.value + 1.0!r}")
            self.add("number", node, start, end, *(new if node.value else new[1:]))


def sites(file: str, text: str) -> list[Site]:
    """All sites of a file, in the order of the file.

    file: its path, relative to the project.
    """
    finder = Finder(file, text)
    finder.visit(ast.parse(text))
    return sorted(finder.found, key=lambda site: (site.start, site.end, site.kind))


def mutated(text: str, site: Site, new: str) -> str:
    """The file with one alternative in its place; it must still be Python."""
    data = text.encode()
    changed = (data[: site.start] + new.encode() + data[site.end :]).decode()
    ast.parse(changed)
    return changed
