"""Warnings about a user's files, which the command line prints as one line each."""

import functools
import warnings


class Notice(UserWarning):
    """A warning about a user's file."""


@functools.cache  # a part is built several times, but warns once
def notice(sentence: str, kind: type[Notice] = Notice) -> None:
    """Warn the user with a sentence, once in a process."""
    warnings.warn(sentence, kind, stacklevel=3)
