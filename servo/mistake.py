"""What a person got wrong: light to import, so that it can be caught without its senders."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class Mistake(ValueError):
    """Something the user got wrong, in one sentence: what, where, and what would be right."""


def unknown(key: str, known: Iterable[str], what: str = "key") -> str:
    """The sentence for a key, or something else, that does not exist."""
    names = list(known)
    if not names:
        return f"there is no {what} '{key}'; this kind has no settings"
    near = difflib.get_close_matches(key, names, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"there is {', '.join(names)}"
    return f"there is no {what} '{key}'; {hint}"
