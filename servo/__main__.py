"""The command `servobench`, also as `python -m servo`."""

import signal


def main() -> None:
    """The entry point. Until the command line is imported, Ctrl-C ends it without a traceback."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from servo.cli.main import main as command

    command()


if __name__ == "__main__":
    main()
