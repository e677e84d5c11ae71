"""Figures of a study's runs: paths of the camera in space, and of corners in the picture."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from servo.report.charts import INK, styled, svg
from servo.report.page import LIGHT, Figure
from servo.report.study_data import RunRow, Series, StudyResults
from servo.report.words import listed
from servo.study.scenario_run import CAMERA, CORNERS
from sim.camera.camera import CameraConfig
from sim.types import Array

MOST = 12
"""Most figures."""
PATH = LIGHT[1]
"""Colour of the camera's path."""
GREY = "#8a8f98"
"""Colour of outlines in the image."""
CELL = 2.1
"""Side of one small picture [inch]."""


def paths(study: StudyResults) -> list[Figure]:
    """Return figures of the paths of the camera and of the target's corners, from the runs of the
    first seed: a figure for each combination of values of the axes that are not compared (up to 12
    figures), with a column for each value of the compared axis.

    The list is empty unless the study compares named groups of settings that change more than the
    tracker.
    """
    if study.compared is None or not shows(study):
        return []
    found: dict[str, dict[str, tuple[RunRow, Series]]] = {}
    for row in study.rows:
        series = study.series.get(row["run"])
        if row.get("seed") == study.plan.seeds[0] and series and CAMERA[0] in series:
            other = {key: row[key] for key in study.axes if key != study.compared}
            found.setdefault(listed(other), {})[str(row[study.compared])] = row, series
    return [_figure(title, runs, _size(study)) for title, runs in list(found.items())[:MOST]]


def shows(study: StudyResults) -> bool:
    """Return True if figures of the camera's paths suit a study: it compares named groups of
    settings that change more than the tracker.
    """
    groups = study.plan.table.get("named", {}).get(study.compared, {})
    keys = {key.split(".")[0] for group in groups.values() for key in group}
    return bool(keys - {"tracker"})


def _size(study: StudyResults) -> tuple[int, int]:
    """Return width and height of the camera's pictures [px] in the first scenario of a study."""
    camera = next(iter(study.plan.scenarios.values())).get("camera", {})
    default = CameraConfig()
    return camera.get("width", default.width), camera.get("height", default.height)


def _figure(title: str, runs: dict[str, tuple[RunRow, Series]], size: tuple[int, int]) -> Figure:
    """Return a figure with a column for each of some runs (row and values over time, by the
    column's title): above, the path of the camera in space; below, the paths of the corners in the
    picture, whose width and height are `size` [px].
    """
    paths = {n: np.column_stack([s[k] for k in CAMERA]) for n, (_, s) in runs.items()}
    arrived = [path for name, path in paths.items() if runs[name][0]["success"]]
    most = 1.1 * np.max([np.abs(path).max(axis=0) for path in arrived or paths.values()], axis=0)
    with styled():
        figure = Drawing(figsize=(CELL * len(runs), 2.1 * CELL), layout="constrained")
        for i, (name, (row, series)) in enumerate(runs.items()):
            space: Any = figure.add_subplot(2, len(runs), i + 1, projection="3d")
            own = 1.1 * np.abs(paths[name]).max(axis=0)
            _in_space(space, paths[name], most if (own <= most).all() else own)
            space.set_title(f"{name}\n{row['outcome'].lower()}", fontsize=9)
            image = figure.add_subplot(2, len(runs), len(runs) + i + 1)
            _in_image(image, np.column_stack([series[k] for k in CORNERS]).reshape(-1, 4, 2), size)
        title = title or "Paths"
        return Figure(title, svg(figure, title), drawing=figure)


def _in_space(ax: Any, path: Array, box: Array) -> None:
    """Draw the camera's path (n, 3) [m] in the target's frame, from a ring to a dot.

    The axes reach at least `box` (3,) [m] from the target: x and y to each side, and z upwards. As
    the frame's z axis points into the target, -z is drawn upwards.
    """
    above = box[2]
    aside = max(*box[:2], 0.7 * above)
    x, y, z = path.T * [[1], [1], [-1]]
    ax.plot(x, y, z, color=PATH, lw=1.4)
    ax.scatter(x[:1], y[:1], z[:1], s=28, facecolors="none", edgecolors=PATH)
    ax.scatter(x[-1:], y[-1:], z[-1:], s=20, color=PATH)
    side = 0.1 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    ax.plot(*side.T, np.zeros(5), color=INK, lw=1)
    ax.set(xlim=(-aside, aside), ylim=(-aside, aside), zlim=(0, above))
    ax.set_box_aspect((2 * aside, 2 * aside, above), zoom=1.15)
    ax.view_init(elev=22, azim=-60)
    ax.tick_params(labelsize=7, pad=-2)
    for axis, label, pad in (
        (ax.xaxis, "x [m]", -8),
        (ax.yaxis, "y [m]", -8),
        (ax.zaxis, "-z [m]", -10),
    ):
        axis.set_label_text(label, fontsize=7)
        axis.labelpad = pad
    ax.locator_params(nbins=3)


def _in_image(ax: Axes, corners: Array, size: tuple[int, int]) -> None:
    """Draw the paths of the corners (n, 4, 2) [px], from a ring to a dot, with the first and the
    last outline; `size` is width and height of the picture [px].
    """
    for i, colour in enumerate(LIGHT[:4]):
        u, v = corners[:, i].T
        ax.plot(u, v, color=colour, lw=1)
        ax.plot(u[:1], v[:1], "o", color=colour, ms=4, mfc="none")
        ax.plot(u[-1:], v[-1:], "o", color=colour, ms=3)
    for outline, style in ((corners[0], ":"), (corners[-1], "-")):
        ax.plot(*np.vstack([outline, outline[:1]]).T, color=GREY, lw=0.8, ls=style)
    ax.set(xlim=(0, size[0]), ylim=(size[1], 0), aspect="equal")
    ax.grid(alpha=0.2)
    ax.set_xlabel("u [px]", fontsize=7)
    ax.set_ylabel("v [px]", fontsize=7)
    ax.tick_params(labelsize=7)
    ax.locator_params(nbins=4)
