"""Closing what a block has used: all of it, and no fault of closing hides the block's own."""

from collections.abc import Callable, Generator
from contextlib import contextmanager


@contextmanager
def closing(*closers: Callable[[], object]) -> Generator[None]:
    """Call these, in order, when the block has ended, also those after one that fails.

    Raises:
        BaseException: The first that the block or one of them raised.
    """
    first: BaseException | None = None
    try:
        yield
    except BaseException as error:
        first = error
    for close in closers:
        try:
            close()
        except BaseException as error:
            first = first or error
    if first is not None:
        raise first
