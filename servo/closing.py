"""Closes all objects that a block has used, so that an error while closing hides no other error."""

from collections.abc import Callable, Generator
from contextlib import contextmanager


@contextmanager
def closing(*closers: Callable[[], object]) -> Generator[None]:
    """Call functions in order when the block has ended, all of them even if one raises an
    exception.

    Raises:
        BaseException: The first exception that the block or one of the functions raised.
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
