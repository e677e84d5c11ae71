"""The command `servobench`, also as `python -m servo`."""

import atexit
import gc
import signal

OBJECTS = 50_000
"""New objects after which Python looks for cycles among them. At its default of 700, looking costs
a short command 8 % of its time, most of it in imports, which make no cycles to be freed."""


def main() -> None:
    """Run the command `servobench`. Ctrl-C ends it without a traceback, also while it imports."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.set_threshold(OBJECTS)
    # At the end Python would look for cycles once more, 0.5 s, in memory that is about to be freed.
    atexit.register(gc.freeze)
    from servo.cli.main import main as command

    command()


if __name__ == "__main__":
    main()
