"""Warnings about a user's files, which the command line prints as one line each."""

import functools
import warnings


class Notice(UserWarning):
    """A warning about a file of the user, which the command line prints as one line."""


@functools.cache  # a part is built several times, but warns once
def notice(sentence: str, kind: type[Notice] = Notice) -> None:
    """Issue a Python warning of class `kind` with a sentence for the user; a sentence that this
    process has issued before is left out.
    """
    warnings.warn(sentence, kind, stacklevel=3)
