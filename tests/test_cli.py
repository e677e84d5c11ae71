"""The command line as a user meets it: exit codes, one sentence for each mistake, nothing left
behind.
"""

import json
import subprocess
import sys

import pytest
from machines import machine_with

from servo.cli import main
from servo.output.run_folder import RunFolder
from sim.camera import gl
from tracking import trackers

TRACKERS = ", ".join(trackers.KINDS.names())
QUICK = ["--set", "run.duration=0.2", "--set", "expect={}", "--quiet", "--no-rerun"]


def call(monkeypatch, capfd, *arguments):
    """Exit code, stdout and stderr of a command."""
    monkeypatch.setattr(sys, "argv", ["servobench", *arguments])
    with pytest.raises(SystemExit) as ended:
        main.main()
    out, err = capfd.readouterr()
    return ended.value.code or 0, out, err


@pytest.fixture
def elsewhere(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    return tmp_path


BAD = {
    "unknown scenario": (
        ["run", "sprial"],
        "there is no scenario 'sprial'; did you mean 'spin'? (or give a .toml file)",
    ),
    "unknown key": (
        ["run", "still", "--set", "camera.widht=3"],
        "--set camera.widht=3: camera: there is no key 'widht'; did you mean 'width'?",
    ),
    "unknown kind": (
        ["run", "still", "--set", "tracker.kind=magic"],
        f"--set tracker.kind=magic: tracker.kind: there is no kind 'magic'; there is {TRACKERS}",
    ),
    "a camera that sees too far to the side": (
        ["run", "still", "--set", "camera.fx=10"],
        "still: camera: the border of the picture is more than 85 deg from the optical axis, which "
        "cannot be rendered; use a longer focal length",
    ),
    "a region outside the image": (
        ["run", "still", "--set", "start.x=200"],
        "still: first frame: the region spans 321..399 x 92..148 px; most of it must be inside the image "
        "of 320 x 240 px",
    ),
    "a region of zero size": (
        ["run", "still", "--set", "region.width=0"],
        "still: first frame: the region is 0 x 34.8 px; both sides must be at least 4 px",
    ),
    "a start the robot cannot reach": (
        ["run", "still", "--set", "goal.depth=4"],
        "still: start: the robot cannot bring the camera to its start pose: 1.68 m and "
        "0 deg are left, and joint 'z' is at its limit; change [start] or [goal]",
    ),
    "an .rrd that is none": (
        ["view", "fake.rrd"],
        "fake.rrd: this is not a Rerun recording (.rrd): name one",
    ),
    "an .rrd that is missing": (
        ["view", "gone.rrd"],
        "gone.rrd: cannot read this recording: No such file or directory",
    ),
    "a folder without a recording": (
        ["view", "empty"],
        "empty/run.rrd: cannot read this recording: No such file or directory",
    ),
    "a kind that does not exist": (
        ["list", "magic"],
        "there is no part, section or kind 'magic'; there is scenario, study, robot, target, "
        "motion, tracker, features, estimator, controller, disturbances, sequences, run, world, "
        "camera, goal, at_goal, leader, start, region, sight, believed, measure, ground, walls, clutter, "
        "light, recording, vary, "
        "expect, sweep, and the kinds that servobench list shows",
    ),
    "a folder that is full": (
        ["run", "still", "--out", "full"],
        "full: this folder is not empty; choose another with --out",
    ),
    "a folder that is a file": (
        ["run", "still", "--out", "fake.rrd"],
        "fake.rrd: cannot write to this folder: File exists; choose another place",
    ),
    "a folder nobody can make": (
        ["run", "still", "--out", "/proc/servobench"],
        "/proc/servobench: cannot write to this folder: No such file or directory; choose another place",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_is_one_sentence_exit_2_and_leaves_nothing(monkeypatch, capfd, elsewhere, case):
    (elsewhere / "fake.rrd").write_text("not a recording")
    (elsewhere / "empty").mkdir()
    (elsewhere / "full").mkdir()
    (elsewhere / "full" / "notes.txt").write_text("mine")
    before = sorted(p.name for p in elsewhere.rglob("*"))
    arguments, message = BAD[case]
    code, _, err = call(monkeypatch, capfd, *arguments)
    assert (code, err) == (2, f"servobench: {message}\n")
    assert sorted(p.name for p in elsewhere.rglob("*")) == before


@pytest.mark.parametrize("command", [["run", "still", *QUICK], ["check", "still"]])
def test_without_a_gl_library_it_is_named_and_the_exact_renderer_is_used(
    monkeypatch, capfd, elsewhere, command
):
    machine_with(monkeypatch)
    monkeypatch.setenv(gl.WITHOUT, "")  # the command sets it: it is taken back after the test
    monkeypatch.delenv(gl.WITHOUT)
    gl.is_there.cache_clear()
    code, _, err = call(monkeypatch, capfd, *command)
    assert code == 0
    assert err == (
        "servobench: The OpenGL library libEGL.so.1 is missing on this machine: "
        f'run {gl.INSTALL}. camera.renderer = "exact" is used.\n'
    )
    gl.is_there.cache_clear()
    if command[0] == "run":
        report = json.loads((elsewhere / "runs" / "still-0" / "report.json").read_text())
        assert report["versions"]["pictures"] == "exact, without OpenGL"


def test_runs_never_overwrite_each_other(monkeypatch, capfd, elsewhere):
    for _ in range(2):
        assert call(monkeypatch, capfd, "run", "still", "--seed", "4", *QUICK)[0] == 0
    assert sorted(p.name for p in (elsewhere / "runs").iterdir()) == ["still-4", "still-4-2"]
    names = {p.name for p in (elsewhere / "runs" / "still-4").iterdir()}
    assert names == {"errors.png", "target_motion.png", "report.json", "steps.parquet"}


def test_a_missed_bound_exits_1_with_the_command_that_repeats_it(monkeypatch, capfd, elsewhere):
    shorter = ["--set", "run.duration=0.2", "--set", "measure.after=0.0"]
    change = [*shorter, "--set", "expect.servo_rms_px=0.5"]
    code, out, err = call(monkeypatch, capfd, "check", "still", *change, "--seed", "3")
    assert code == 1
    assert "missed: servo_rms_px is" in err
    command = f"servobench run still {' '.join(change)} --seed 3"
    assert f"  again: {command}\n" in err
    assert "TIMED_OUT" in out


@pytest.mark.usefixtures("no_progress")
def test_check_passes_where_the_bounds_are_kept(monkeypatch, capfd, elsewhere):
    code, out, err = call(monkeypatch, capfd, "check", "still")
    assert (code, err) == (0, "")
    assert "8 of 8" in out
    assert list(elsewhere.iterdir()) == []


def test_list_names_everything_and_shows_settings(monkeypatch, capfd):
    _, out, _ = call(monkeypatch, capfd, "list")
    for name in ("reversal_5hz", "wander", "pf_ssd", "kalman_cv", "ibvs", "board"):
        assert name in out
    assert "Which one?" not in out
    _, out, _ = call(monkeypatch, capfd, "list", "tracker")
    for word in ("Which one?", "NanoTrack", "texture_pf", "recordings", "fails"):
        assert word in out
    _, out, _ = call(monkeypatch, capfd, "list", "kalman_cv")
    assert "estimator.rho" in out
    assert "0.6" in out


def test_doctor_tells_the_renderer_and_its_speed(monkeypatch, capfd):
    code, out, _ = call(monkeypatch, capfd, "doctor")
    assert code == 0
    back_end = "egl" if gl.is_there() else "none"
    for word in (back_end, "renderer", "frames a second", "mujoco", "scipy"):
        assert word in out


def test_ctrl_c_keeps_what_was_written_and_says_so(monkeypatch, capfd, elsewhere):
    add = RunFolder.add

    def interrupted(folder, step):
        if step.frame.index == 20:
            raise KeyboardInterrupt
        add(folder, step)

    monkeypatch.setattr(RunFolder, "add", interrupted)
    code, _, err = call(monkeypatch, capfd, "run", "still", "--no-rerun", "--out", "out")
    assert code == 130
    assert err == "servobench: stopped; what was written is complete up to here.\n"
    import pyarrow.parquet as pq

    assert pq.read_table(elsewhere / "out" / "steps.parquet").num_rows == 20


def test_help_works_without_heavy_imports():
    code = (
        "import sys, servo.cli.main\n"
        "heavy = {'mujoco', 'rerun', 'numba', 'matplotlib', 'cv2', 'scipy', 'pyarrow'}\n"
        "heavy &= set(sys.modules)\n"
        "sys.exit(f'imported: {heavy}' if heavy else 0)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
