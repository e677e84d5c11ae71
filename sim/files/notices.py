"""Sentences about a user's files that are no errors: warnings that the command line prints."""

import functools
import warnings


class Notice(UserWarning):
    """A sentence for the user about a file."""


@functools.cache  # a part is built several times, and it is said once
def notice(sentence: str, kind: type[Notice] = Notice) -> None:
    """Warn of something."""
    warnings.warn(sentence, kind, stacklevel=3)
