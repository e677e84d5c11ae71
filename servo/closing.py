"""A context manager that calls several functions, such as those that close files, when its block
has ended. The first exception is raised, so that a later one does not hide it.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager


@contextmanager
def closing(*closers: Callable[[], object]) -> Generator[None]:
    """Context manager: when its block has ended, call the given functions in order and without
    arguments, even if the block or one of the functions raises an exception.

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
