"""What several tests need: a renderer of one thread, the shared measurements, a painted picture."""

import gc
import json
import os
import shutil
import signal
import subprocess
import sys
import zlib
from contextlib import ExitStack
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "0")  # before any GL context: tests run side by side
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: threads wait for each other
# Programs that tests start do not print that OpenGL is missing: what they print is compared.
os.environ.setdefault("SERVOBENCH_WITHOUT_OPENGL", "1")

import cv2
import numpy as np
import pytest
from approved import approved, drawn, section  # noqa: F401  (fixtures)
from commands import scheduler_with
from filelock import FileLock
from hypothesis import HealthCheck, settings
from matplotlib.figure import Figure
from preloaded import preloaded
from seen_targets import model_folder, show_target  # noqa: F401  (fixtures)

from servo.__main__ import OBJECTS
from sim.camera import gl

# The same examples in each run: what CI finds anybody finds. The first call compiles: no deadline.
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell starts what runs in the background so, and all that the tests start would not hear Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup starts what it runs so

ROOT = Path(__file__).parents[1]
REFERENCE_CASES = {
    "visp_run": ("visp_closed_loops.json", "runs"),
    "moment_case": ("moment_vectors.json", "cases"),
    "scheme_case": ("schemes_vectors.json", "cases"),
    "luminance_case": ("schemes_vectors.json", "luminance"),
    "scheme_loop": ("schemes_loops.json", "cases"),
}
"""Arguments of tests marked `reference`, with the file and the list that their values are from."""


def reference_folder():
    """The reference data: the folder that SERVOBENCH_REFERENCE names, or the few cases here."""
    return Path(os.environ.get("SERVOBENCH_REFERENCE") or ROOT / "tests" / "data")


def sequences_folder():
    """The folder of annotated sequences that SERVOBENCH_SEQUENCES names; None where it is unset."""
    named = os.environ.get("SERVOBENCH_SEQUENCES")
    return Path(named) if named else None


WALLS = {
    "test_believed",
    "test_bench::test_a_track_that_is_lost_is_computed_again",
    "test_checks::test_every_shipped_kind_keeps_its_contract",
    "test_closed_loop",
    "test_contracts",
    "test_depth_points",
    "test_distortion::test_any_coefficients_are_a_camera_or_a_sentence",
    "test_estimation::test_innovations_in_the_rendered_loop",
    "test_estimation_errors::test_estimates_in_the_rendered_loop_are_as_wrong_as_they_say",
    "test_every_setting",
    "test_example_scripts",
    "test_extremes",
    "test_feature_sets::test_every_scheme_follows_a_moving_tag_with_every_kind_of_filter",
    "test_features_lenses",
    "test_formats::test_the_page_of_each_folder_shows_the_stored_command",
    "test_identify_contradictions",
    "test_identify_robots::test_positions_and_commands_of_another_unit_are_doubted",
    "test_inputs",
    "test_lens",
    "test_limits",
    "test_mutations",
    "test_new::test_each_part_keeps_its_contract_and_holds_the_target",
    "test_odd_pictures",
    "test_papers_judges",
    "test_photo::test_dots_on_the_plane_are_where_they_were",
    "test_properties_reports",
    "test_properties_trackers",
    "test_range_ends",
    "test_recognition::test_a_target_out_of_the_picture_is_lost_within_a_second_and_found_again",
    "test_scenarios",
    "test_schemes::test_closed_loop_of_a_scheme",
    "test_tag_tracker::test_corners_are_found_from_any_side",
    "test_textbook",
    "test_vary",
}
"""Files, or tests, that try every setting, input, scenario, scheme, kind or example, mostly in whole runs."""
PLAIN_SHARE = 20
"""The plain command runs one in so many of their cases, the same ones each time."""
PLAIN_SECONDS = 0.5
"""The plain command leaves out other tests that took as long or longer when they were timed [s]."""
PROGRAM_SECONDS = 15.0
"""The same of tests that start programs, for `-m "processes and not wide"`; four ran at once when they
were timed, on two cores [s]."""
WIDE = "wide and not processes"
"""The option -m that asks for the others."""
LAID_OUT = {"test_bench", "test_identify", "test_papers", "test_report", "test_run_numbers"}
"""Files whose figures are laid out as a user's, one for each kind of figure."""


LONG = json.loads((ROOT / "tests" / "data" / "durations.json").read_text())
"""The long tests of each file, with the times that they took [s], as tests/tools/durations.py wrote
them."""


def pytest_xdist_auto_num_workers(config):
    """Tests that start programs wait half of their time: twice as many at once."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return 2 * cores if config.option.markexpr.startswith("processes") else None


def pytest_configure(config):
    """Where tests start programs, have a process that starts them quickly, for all workers."""
    starts = "not processes" not in config.option.markexpr
    if starts and not hasattr(config, "workerinput") and not config.option.collectonly:
        there = ExitStack()
        there.enter_context(preloaded())
        config.add_cleanup(there.close)


def pytest_ignore_collect(collection_path, config):
    """Import no file that has none of the wanted tests, where few files have any."""
    if collection_path.suffix != ".py":
        return None
    wanted, text = config.option.markexpr, collection_path.read_text()
    if wanted.startswith("processes"):
        some = "mark.processes" in text
    elif wanted == WIDE:
        named = {*LONG, *(wall.split(":")[0] for wall in WALLS)}
        some = "mark.wide" in text or collection_path.stem in named
    else:
        some = True
    return None if some else True


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Half a million objects live until the end: do not search them for garbage again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(OBJECTS)
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    longest = {file: max(tests.values()) for file, tests in LONG.items()}
    items.sort(key=lambda item: -longest.get(item.path.stem, 0.0))
    for item in items:
        names = {item.path.stem, f"{item.path.stem}::{item.originalname}"}
        if hasattr(item, "callspec") and not WALLS.isdisjoint(names):
            is_plain = zlib.crc32(item.nodeid.encode()) % PLAIN_SHARE == 0
        else:
            starts = item.get_closest_marker("processes") is not None
            limit = PROGRAM_SECONDS if starts else PLAIN_SECONDS
            is_plain = LONG.get(item.path.stem, {}).get(item.name, 0.0) < limit
        if not is_plain:
            item.add_marker("wide")


NO_OPENGL = "OpenGL is missing"
"""Why a test that is marked `opengl` was skipped."""


def pytest_runtest_setup(item):
    if item.get_closest_marker("opengl") and not gl.is_there():
        pytest.skip(NO_OPENGL)


def pytest_terminal_summary(terminalreporter):
    skipped = terminalreporter.getreports("skipped")
    count = sum(report.longrepr[2] == f"Skipped: {NO_OPENGL}" for report in skipped)
    if count:
        line = f"{NO_OPENGL}: tests that need its pictures and were skipped: {count}"
        terminalreporter.write_line(line, yellow=True)


def pytest_report_header():
    sequences = sequences_folder() or "none (SERVOBENCH_SEQUENCES): tests on them are skipped"
    return [f"reference data: {reference_folder()}", f"annotated sequences: {sequences}"]


def pytest_generate_tests(metafunc):
    """One test for each reference case there is; never none: a missing file is an error."""
    for name, (file, key) in REFERENCE_CASES.items():
        if name in metafunc.fixturenames:
            cases = json.loads((reference_folder() / file).read_text())[key]
            assert cases, file
            metafunc.parametrize(name, cases, ids=[str(i) for i in range(len(cases))])


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """Gives a folder by its name, which one worker makes and all others use."""
    own = tmp_path_factory.getbasetemp()
    place = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own

    def folder_of(name, make):
        folder, done = place / name, place / f"{name}.done"
        with FileLock(f"{folder}.lock"):
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                make(folder)
                done.touch()
        return folder

    return folder_of


@pytest.fixture(scope="session")
def shared_sequences() -> Path:
    folder = sequences_folder()
    if folder is None:
        pytest.skip("SERVOBENCH_SEQUENCES names no folder of annotated sequences")
    assert folder.is_dir(), folder
    return folder


@pytest.fixture(scope="session")
def smooth_image():
    """A colourful random picture (120, 160, 3) without sharp edges, read-only as those of frames."""
    noise = np.random.default_rng(0).normal(128, 90, (120, 160, 3))
    blurred = cv2.GaussianBlur(noise, (0, 0), 3)
    image = np.clip((blurred - 128) * 3 + 128, 0, 255).astype(np.uint8)
    image.setflags(write=False)
    return image


@pytest.fixture(autouse=True)
def not_laid_out(request, monkeypatch):
    """Elsewhere figures are drawn where Matplotlib puts their parts at first: to make room for each
    label takes two fifths of the time of a figure.
    """
    if request.path.stem in LAID_OUT:
        return

    def as_it_is(figure, *given, **named):
        figure.set_layout_engine("none")
        return savefig(figure, *given, **named)

    savefig = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", as_it_is)


@pytest.fixture
def no_progress(monkeypatch):
    """Jobs print no lines of progress, which a slow machine would."""
    from servo.cli import jobs

    monkeypatch.setattr(jobs, "FIRST", np.inf)


@pytest.fixture
def undrawn(monkeypatch):
    """Figures of pages have their titles and no lines: drawing takes half of the time of a page."""
    from markupsafe import Markup

    from servo.report import charts, study_paths

    def titled(_figure, title):
        return Markup('<svg role="img" aria-label="{}"></svg>').format(title)

    monkeypatch.setattr(charts, "svg", titled)
    monkeypatch.setattr(study_paths, "svg", titled)


@pytest.fixture(scope="session")
def ran(made_once):
    """The folder of a real run of half a second that misses one of two bounds; copy it to change
    it.
    """
    from servo.cli import run_command

    changes = [
        "run.duration=0.5",
        "measure.after=0.4",
        "expect={}",
        "expect.tilt_peak_deg=1.0",
        "expect.servo_rms_px=0.5",
        "tracker.kind=mean_shift",
    ]

    def make(folder):
        out = folder / "out"
        assert run_command.run("still", changes, 3, out, quiet=True) == 1

    return made_once("run", make) / "out"


@pytest.fixture(scope="session")
def make_papers():
    """Writes what `servobench papers` leaves, with two claims and a figure, into a folder."""

    from servo.papers.claim import Rule
    from servo.papers.claims import Judged, PapersReport

    def make(folder):
        (folder / "figures").mkdir(parents=True)
        rule = Rule("error", "as they are", "2 worlds", "1 px", "none", "below 1 px")
        claims = {
            name: Judged(
                "it is so",
                rule,
                finding,
                1.5,
                1.0,
                2.25,
                "px",
                2,
                "1 & 2",
                [["x"], ["7"]],
                ["figures/one.png"],
            )
            for name, finding in (("P0-1a", "holds"), ("P2-2", "does not hold"))
        }
        line = "servobench papers P0-1a P2-2 --quick"
        versions = {"servobench": "0.1.0"}
        PapersReport(command=line, versions=versions, quick=True, claims=claims).write(folder)
        cv2.imwrite(str(folder / "figures" / "one.png"), np.zeros((30, 60, 3), np.uint8))
        return folder

    return make


SMALL_STUDY = """# mine
# A car that stands.
scenario = "still"
seeds = 2

[set]
run.duration = 0.2
tracker.kind = "frozen"
estimator.kind = "none"

[axes]
run.latency = [0, 2]
start.x = { uniform = [-20.0, 20.0] }
"""


@pytest.fixture
def study_place(tmp_path, monkeypatch):
    """The current folder, with a study of four quick runs in mine.toml."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(SMALL_STUDY)
    return tmp_path


@pytest.fixture(scope="session")
def finished_study(tmp_path_factory):
    """The folder of that study with its four runs; copy it to change it."""

    from servo.study import store
    from servo.study.parse import load
    from servo.study.store import StudyFile

    there = tmp_path_factory.mktemp("finished")
    (there / "mine.toml").write_text(SMALL_STUDY)
    study = load(str(there / "mine.toml"))
    with store.opened(there / "out", StudyFile.of(study, "me")) as kept:
        for job in study.jobs():
            kept.add(job, job.run(kept.folder))
    return there / "out"


@pytest.fixture
def no_workers(monkeypatch):
    """`servobench sweep` works in this process: a worker takes two seconds to start."""
    from servo.cli import sweep_command
    from servo.study.execute import Workers

    monkeypatch.setattr(sweep_command, "Workers", lambda count, scheduler: Workers())


@pytest.fixture
def cluster():
    """Starts a scheduler with workers; gives their processes, the scheduler first, and its
    address.
    """
    with ExitStack() as started:
        yield lambda *options, **more: started.enter_context(scheduler_with(*options, **more))


@pytest.fixture(scope="session")
def wheel(root, made_once):
    """The project's wheel, built."""

    def build(folder):
        command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
        subprocess.run(command, cwd=root, check=True, capture_output=True)

    (found,) = made_once("wheel", build).glob("*.whl")
    return found


@pytest.fixture(scope="session")
def pip():
    """Installs without dependencies, by uv where it is there."""

    def install(*arguments):
        uv = os.environ.get("UV") or shutil.which("uv")
        tool = [uv, "pip"] if uv else [sys.executable, "-m", "pip"]
        subprocess.run([*tool, "install", "--no-deps", *arguments], check=True, capture_output=True)

    return install


@pytest.fixture(scope="session")
def installed(wheel, pip, made_once):
    """A folder with the wheel installed into it, and with the loops that are compiled here."""

    def install(folder):
        pip("--target", str(folder), str(wheel))
        there, here = folder / "tracking" / "loops", ROOT / "tracking" / "loops"
        for source in here.glob("*.py"):  # of the same time as here, as numba's files have it
            shutil.copystat(source, there / source.name)
        (there / "__pycache__").mkdir(exist_ok=True)
        for loop in (here / "__pycache__").glob("*.nb[ci]"):
            shutil.copy2(loop, there / "__pycache__")

    return made_once("installed", install)


@pytest.fixture
def browser(tmp_path):
    selenium = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    driver = shutil.which("chromedriver")
    if driver is None or shutil.which("chromium") is None:
        pytest.skip("Chromium and its driver are not on this machine")
    options = selenium.ChromeOptions()
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--no-first-run",
        "--enable-unsafe-swiftshader",  # WebGL without a GPU, for Rerun's viewer
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        f"--user-data-dir={tmp_path / 'profile'}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = selenium.Chrome(options, selenium.ChromeService(executable_path=driver))
    yield opened
    opened.quit()
