"""The command `servobench doctor`: report renderer, versions and speed of this machine."""

import platform
from statistics import median

from rich.console import Console

from servo.cli.terminal import complain, plain, print_table
from servo.loop.episode import Episode
from servo.output.versions import clash, versions
from servo.report.words import Table
from servo.scenario import load as scenarios
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.fill import form
from sim.camera import gl
from sim.kinds import UnknownKind
from tracking.guests.cv2_tracker import running

FINE = "All is well. To begin with: servobench run reversal"


def run() -> int:
    """Print what this machine has: the OpenGL back end, the renderer, the rendered frames per
    second of the scenario "still", and the versions of packages; then what is wrong.

    Returns:
        The exit code: 1 if a package with plug-ins cannot be loaded or several packages of OpenCV
        are installed, else 0.
    """
    console = Console()
    opengl = gl.is_there()
    # Without latency a run makes each picture only when it is needed, so that its time counts.
    scenario = scenarios.load("still", ["run.latency=0"])
    with Episode(scenario) as episode:
        seconds = median(step.seconds.render for step in episode)
    camera = scenario.camera
    rows = {
        "OpenGL back end": gl.backend() if opengl else "none",
        "renderer": gl.describe() if opengl else "exact",
        "frames a second": f"{1 / seconds:.0f} at {camera.width} x {camera.height}",
        "OpenCV": running(),
        "Python": platform.python_version(),
        **versions(),
    }
    print_table(console, Table(("what", "found"), list(rows.items()), words=range(2)))
    found = _broken()
    if sentence := clash():
        found.append(f"{sentence}; OpenCV {running()} is used")
    complain(*found)
    plain(console, FINE * (not found))
    return bool(found)


def _broken() -> list[str]:
    """Return a sentence for each kind of component (tracker, robot, ...) of an installed plug-in
    package that cannot be loaded.
    """
    reasons: list[str] = []
    for kinds in [registry for registry, _ in PLUGINS.values()] + list(LISTS.values()):
        for kind in filter(kinds.package_of, kinds.names()):
            try:
                form(kinds.config_of(kind), described=False)
            except UnknownKind as error:
                reasons.append(str(error))
    return reasons
