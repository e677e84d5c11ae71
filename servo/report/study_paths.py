"""Small multiples of a study's runs: paths of the camera in space, and of corners in the image."""

import io
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from servo.report.page import PageImage
from servo.report.study_data import Row, Series, StudyResults
from servo.report.words import listed
from servo.study.scenario_run import CAMERA, CORNERS
from sim.camera.camera import CameraConfig
from sim.types import Array
from tracking.drawing.figures import DOTS, literal

MOST = 12
COLOURS = ("#c23b2e", "#2b6cb0", "#1f7a3a", "#b7791f")
PATH, GREY = "#2b6cb0", "#8a8f98"
CELL = 2.1
"""Side of one small picture [inch]."""


def paths(study: StudyResults) -> list[PageImage]:
    """Return a picture for each combination of the other axes, with a column for each value of the
    axis that is compared; of the first seed. Only studies of named groups have them.
    """
    if study.compared is None or not shows(study):
        return []
    found: dict[str, dict[str, tuple[Row, Series]]] = {}
    for row in study.rows:
        series = study.series.get(row["run"])
        if row.get("seed") == study.plan.seeds[0] and series and CAMERA[0] in series:
            other = {key: row[key] for key in study.axes if key != study.compared}
            found.setdefault(listed(other), {})[str(row[study.compared])] = row, series
    return [
        _picture(title, _drawn(runs, _size(study))) for title, runs in list(found.items())[:MOST]
    ]


def shows(study: StudyResults) -> bool:
    """Return whether the study compares named groups of settings, and not of trackers only: these
    have such pictures.
    """
    groups = study.plan.table.get("named", {}).get(study.compared, {})
    keys = {key.split(".")[0] for group in groups.values() for key in group}
    return bool(keys - {"tracker"})


def _size(study: StudyResults) -> tuple[int, int]:
    """Return width and height of the camera's pictures [px]."""
    camera = next(iter(study.plan.scenarios.values())).get("camera", {})
    default = CameraConfig()
    return camera.get("width", default.width), camera.get("height", default.height)


def _picture(title: str, figure: Figure) -> PageImage:
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DOTS)
    place = f"paths of {title}"
    return PageImage.of(title or "Paths", file.getvalue(), place, sheet=False, drawing=figure)


def _drawn(runs: dict[str, tuple[Row, Series]], size: tuple[int, int]) -> Figure:
    figure = Figure(figsize=(CELL * len(runs), 2.1 * CELL), layout="constrained")
    ways = {n: np.column_stack([s[k] for k in CAMERA]) for n, (_, s) in runs.items()}
    arrived = [way for name, way in ways.items() if runs[name][0]["success"]]
    most = 1.1 * np.max([np.abs(way).max(axis=0) for way in arrived or ways.values()], axis=0)
    for i, (name, (row, series)) in enumerate(runs.items()):
        space: Any = figure.add_subplot(2, len(runs), i + 1, projection="3d")
        _in_space(space, ways[name], max(*most[:2], 0.7 * most[2]), most[2])
        space.set_title(literal(f"{name}\n{row['outcome'].lower()}"), fontsize=9)
        image = figure.add_subplot(2, len(runs), len(runs) + i + 1)
        _in_image(image, np.column_stack([series[k] for k in CORNERS]).reshape(-1, 4, 2), size)
    return figure


def _in_space(ax: Any, way: Array, aside: float, above: float) -> None:
    """The camera's way (n, 3) over the target, from a ring to a dot, as far as these sides [m]."""
    box = np.array([aside, aside, above])
    x, y, z = np.clip(way, -box, box).T * [[1], [1], [-1]]
    ax.plot(x, y, z, color=PATH, lw=1.4)
    ax.scatter(x[:1], y[:1], z[:1], s=28, facecolors="none", edgecolors=PATH)
    ax.scatter(x[-1:], y[-1:], z[-1:], s=20, color=PATH)
    side = 0.1 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    ax.plot(*side.T, np.zeros(5), color="black", lw=1)
    ax.set(xlim=(-aside, aside), ylim=(-aside, aside), zlim=(0, above))
    ax.set_box_aspect((2 * aside, 2 * aside, above), zoom=1.25)
    ax.view_init(elev=22, azim=-60)
    ax.tick_params(labelsize=7, pad=-2)
    ax.locator_params(nbins=3)


def _in_image(ax: Axes, corners: Array, size: tuple[int, int]) -> None:
    """The corners' ways (n, 4, 2) [px], from a ring to a dot, and the first and last outline, in a
    picture of a size.
    """
    for i, colour in enumerate(COLOURS):
        u, v = corners[:, i].T
        ax.plot(u, v, color=colour, lw=1)
        ax.plot(u[:1], v[:1], "o", color=colour, ms=4, mfc="none")
        ax.plot(u[-1:], v[-1:], "o", color=colour, ms=3)
    for outline, style in ((corners[0], ":"), (corners[-1], "-")):
        ax.plot(*np.vstack([outline, outline[:1]]).T, color=GREY, lw=0.8, ls=style)
    ax.set(xlim=(0, size[0]), ylim=(size[1], 0), aspect="equal")
    ax.grid(alpha=0.2)
    ax.tick_params(labelsize=7)
    ax.locator_params(nbins=4)
