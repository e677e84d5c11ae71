"""Command line of the servers: a tracker and its settings; the client is at standard input."""

import argparse
import sys
import tomllib
from collections.abc import Callable

from sim.installed import plain


def serve(name: str, run: Callable[..., None], *, seeded: bool = False) -> None:
    """Serve the tracker that the command line names until the client ends; exit code 1 for an
    error, 2 for a wrong command line, 130 for Ctrl-C.

    Args:
        name: The server's module in this package.
        run: Function that serves a tracker; it gets the tracker's kind, and by name `preset`, the
            settings and, with `seeded`, `seed`.
        seeded: Whether the command line has an option --seed.
    """
    parser = argparse.ArgumentParser(prog=f"python -m tracking.exported.{name}")
    parser.add_argument("kind")
    parser.add_argument("settings", nargs="*", help="such as particles=80")
    if seeded:
        parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--preset")
    given = vars(parser.parse_args())
    if None in (sys.stdin, sys.stdout):
        parser.error("standard input or output is closed, but a client needs both")
    kind = given.pop("kind")
    texts = given.pop("settings")
    try:
        run(kind, **given, **tomllib.loads("\n".join(texts)))
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    except (ValueError, TypeError, OSError) as error:
        raise SystemExit(f"{name}: {plain(str(error))}") from None
