"""Command line of the servers: a tracker and its settings; the client is at standard input."""

import argparse
import sys
import tomllib
from collections.abc import Callable

from sim.installed import plain


def serve(module: str, run: Callable[..., None], *, seeded: bool = False) -> None:
    """Serve the tracker, or other component, that the command line names, until the client ends;
    exit code 1 for an error, 2 for a wrong command line, 130 for Ctrl-C.

    Args:
        module: The server's module, such as "tracking.exported.program_server".
        run: Function that serves a tracker, or another component. Its argument is the component's
            kind; its keyword arguments are `preset`, the settings and, with `seeded`, `seed`.
        seeded: Whether the command line has an option --seed.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {module}")
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
        raise SystemExit(f"{module.rpartition('.')[2]}: {plain(str(error))}") from None
