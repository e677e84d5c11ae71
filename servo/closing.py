"""A context manager that closes several objects after a block; the first error is raised, so that
an error of closing hides no other.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager


@contextmanager
def closing(*closers: Callable[[], object]) -> Generator[None]:
    """Call all functions in order when the block has ended, even if the block or one of them raises
    an exception.

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
