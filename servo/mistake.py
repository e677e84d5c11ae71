"""What a person got wrong: light to import, so that it can be caught without its senders."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

LONGEST = 2000
"""A sentence that quotes more than can be read keeps its two ends [characters]."""


class Mistake(ValueError):
    """Something the user got wrong, in one sentence: what, where, and what would be right.

    What it quotes may be anything, so line breaks and control characters are written out.
    """

    def __init__(self, sentence: str) -> None:
        line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in sentence)
        if len(line) > LONGEST:
            line = f"{line[: LONGEST // 2]} [...] {line[-LONGEST // 2 :]}"
        super().__init__(line)


class Refused(Mistake):
    """Something the machine refuses, in one sentence: what, and what would help; exit code 1."""


def unknown(key: str, known: Iterable[str], what: str = "key") -> str:
    """The sentence for a key, or something else, that does not exist."""
    names = list(known)
    if not names:
        return f"there is no {what} '{key}'; this kind has no settings"
    near = difflib.get_close_matches(key, names, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"there is {', '.join(names)}"
    return f"there is no {what} '{key}'; {hint}"
