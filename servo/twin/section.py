"""The page of a comparison of a robot's log with the film of its camera: a table, the curve of the
offset, and the motion that the film shows beside the one that the log predicts.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from servo.output.formats import Made
from servo.report.page import Block, Fact, PageImage, Section, again
from servo.report.words import Badge, Cell, Table, Tone
from servo.twin.compare import Comparison
from servo.twin.offset import regressors
from servo.twin.verdict import State
from tracking.drawing.figures import Drawing, panels
from tracking.drawing.picture_bytes import encoded

FLOWS = (
    "to the right [1/s]",
    "wider [1/s]",
    "sheared [1/s]",
    "down [1/s]",
    "sheared back [1/s]",
    "higher [1/s]",
)
"""Labels of the six components of an affine flow, in the order of `affine_flows`."""
SHOWN = 0, 3, 1, 4
"""Indices of the components that are drawn."""
SECONDS = 12.0
"""Length of the part of the film that is drawn [s]."""
MM = 1e3
SHOWN_PICTURES = 4
BADGES = {
    State.OK: Badge("ok", Tone.GOOD),
    State.ADJUST: Badge("adjust", Tone.BAD),
    State.WRONG: Badge("wrong", Tone.BAD),
    State.REFUSED: Badge("refused", Tone.BAD),
    State.UNKNOWN: Badge("unknown", Tone.PLAIN),
}
LEGEND = "; ".join(
    f"{badge.text}: {state.value}" for state, badge in BADGES.items() if state is not State.OK
)


def table(compared: Comparison) -> Table:
    """Return the table of a comparison of log and film: a row for each finding, whether it is ok,
    to be adjusted, wrong, refused or unknown, and what to change.
    """
    rows: list[list[Cell]] = [
        [each.what, BADGES[each.state], each.found, each.change]
        for each in compared.verdict.findings
    ]
    return Table(("", "", "found", "what to change"), rows, range(4), LEGEND)


def section(
    compared: Comparison,
    folder: Path,
    made: Made,
    more: Sequence[Block] = (),
    kind: str = "pre-flight",
) -> Section:
    """Return the section of an HTML page about a comparison of log and film.

    Args:
        compared: The comparison.
        folder: The folder of the page, whose path the section shows.
        made: The command line and the versions of the packages.
        more: Further blocks, before the pictures of the film.
        kind: What the page calls the section: "pre-flight" or "twin".
    """
    verdict = compared.verdict
    tracks = compared.fits.tracks
    seconds = float(tracks.times[-1] - tracks.times[0])
    changes = sum(bool(each.change) for each in verdict.findings)
    lead = "Log and film fit each other. " * verdict.is_good
    if changes:
        lead += f"Lines that say what to change before the robot moves by its camera: {changes}."
    facts = [
        Fact(
            "film",
            f"{seconds:.1f} s",
            f"{len(tracks.times)} pictures, {tracks.size[0]} x {tracks.size[1]} px",
        ),
        Fact("points followed", f"{tracks.known.sum():,}"),
        Fact("points off the fit", f"{compared.fits.mount.off:.2f} px", "median"),
        Fact(
            "depth of the offset's curve",
            f"{compared.fits.offset.depth:.1f}",
            "at least 3 is needed",
        ),
    ]
    pictures = [
        PageImage.of("", encoded(image), "picture", sheet=False)
        for image in tracks.middles[:SHOWN_PICTURES]
    ]
    blocks = [
        Block("What is wrong, and what to change", tables=[table(compared)], points=verdict.doubts),
        Block(
            "The clock's offset",
            pictures=[PageImage.of("", curve(compared).png(), "curve", sheet=False)],
        ),
        Block(
            "Motion in the film (dots), and by the log (lines)",
            pictures=[PageImage.of("", flows(compared).png(), "flows", sheet=False)],
        ),
        *more,
        Block("Pictures of the film", pictures=pictures, folded=True),
        again(made),
    ]
    tone = Tone.PLAIN if verdict.limits else Tone.GOOD
    badge = Badge(verdict.summary, tone if verdict.is_good else Tone.BAD)
    return Section(kind, "Log against film", lead, badge, facts, blocks, str(folder))


def curve(compared: Comparison) -> Drawing:
    """Return a drawing of how badly the log explains the film (log determinant of the residuals'
    covariance) over the offset of the film's clock [ms], with the best offset and its interval.
    """
    figure, (ax,) = panels(9.0, 2.6)
    offset = compared.fits.offset
    ax.plot(MM * offset.offsets, offset.curve, color="#2b6cb0")
    ax.axvspan(MM * (offset.value - offset.half), MM * (offset.value + offset.half), alpha=0.25)
    ax.axvline(MM * offset.value, color="#c23b2e")
    ax.set_xlabel("offset of the film's clock [ms]")
    ax.set_ylabel("log det of residuals")
    return figure


def flows(compared: Comparison) -> Drawing:
    """Return a drawing of four components of the film's affine flow [1/s] over time, beside those
    that the log's motion explains, for 12 s in the middle of the film.
    """
    steps = compared.fits.tracks.steps
    known = regressors(compared.motion, steps, compared.fits.offset.value)
    fit = known @ np.linalg.lstsq(known, compared.flows, rcond=None)[0]
    times = steps.times[steps.first]
    middle = float(np.median(times))
    part = abs(times - middle) < SECONDS / 2
    figure, axes = panels(9.0, 5.4, len(SHOWN), sharex=True)
    for which, ax in zip(SHOWN, axes, strict=True):
        ax.plot(times[part], compared.flows[part, which], ".", ms=3, color="#59616e")
        ax.plot(times[part], fit[part, which], color="#c23b2e", lw=1.2)
        ax.set_ylabel(FLOWS[which], fontsize=8)
    axes[-1].set_xlabel("time of the film [s]")
    return figure
