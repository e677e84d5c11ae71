"""What the commands of the command line have in common: their options, and how they are listed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from servo.signals import ending_signals

Command = TypeVar("Command", bound=Callable[..., Any])

PATH = click.Path(path_type=Path)
COUNT, NATURAL = click.IntRange(min=1), click.IntRange(min=0)

quiet_option = click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes.")
changes_option = click.option(
    "--set", "changes", metavar="KEY=VALUE", multiple=True,
    help="Change any setting; repeat at will.",
)  # fmt: skip
workers_option = click.option(
    "--workers",
    type=COUNT,
    default=2,
    help="Processes side by side.",
    show_default=True,
)


def out_option(default: str) -> Callable[[Command], Command]:
    """The option that names the folder to write."""
    return click.option("--out", type=PATH, help=f"Folder to write (default: {default}).")


class Commands(click.Group):
    """Lists commands in the order of the file; Ctrl-C, TERM and HUP end all of them alike."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  (click's signature)
        return list(self.commands)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command."""
        with ending_signals():
            try:
                return super().invoke(ctx)
            except KeyboardInterrupt as cause:
                from servo.terminal import stop  # only now: it imports rich

                stop(cause)
