"""The arguments of `servobench robot`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from servo.cli.options import PATH, Numbers


@click.command()
@click.argument("model", type=PATH, help="Its file, MJCF or URDF.")
@click.option("--flange", default="", help="The body or site that carries the camera.")
@click.option(
    "--mount", type=Numbers(6), metavar="X,Y,Z,R,P,Y",
    help="The camera in the flange [m, deg] (default: it looks along the flange's z).",
)  # fmt: skip
@click.option("--camera", default="", help="A camera of the model, in place of flange and mount.")
@click.option(
    "--base", type=Numbers(4), metavar="X,Y,Z,YAW",
    help="Where it stands in the room [m, deg] (default: proposed from its reach).",
)  # fmt: skip
@click.option(
    "--out", type=PATH, default=Path("robot.png"), show_default=True, help="Picture to write."
)
def robot(
    model: Path, flange: str, mount: list[float] | None, camera: str, base: list[float] | None,
    out: Path,
) -> None:  # fmt: skip
    """Print a robot's joints, flanges, reach and [robot] table; draw it in the room."""
    from servo.cli.robot_command import examine

    given = {"model": str(model), "flange": flange, "mount": mount, "camera": camera, "base": base}
    sys.exit(examine({key: value for key, value in given.items() if value}, out))
