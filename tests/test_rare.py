"""What happens rarely: nothing seen, nothing there, nothing reachable, everything failed."""

import errno
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from machines import machine_with

from servo.cli import check_command, sweep_command
from servo.mistake import Mistake, Refused, unknown
from servo.sight.estimate_to_sight import EstimateToSight, SightConfig
from servo.study import record_file
from servo.study.cluster.tasks import reason
from servo.study.run import Failure, Job, Record
from servo.study.store import Store
from sim.camera import gl
from sim.types import Camera, Pose
from tracking.appearance.bins import Window
from tracking.appearance.local_patterns import TextureBins
from tracking.sequences.sequence import source_of
from tracking.trackers import general_kinds
from tracking.types import Region, State


def test_a_kind_without_settings_says_so():
    assert unknown("rho", []) == "there is no key 'rho'; this kind has no settings"


def test_before_the_target_was_seen_no_camera_motion_moves_it():
    camera = Camera(290.0, 290.0, 160.0, 120.0, 320, 240)
    outline = np.array([[-0.1, 0.05, 0], [0.1, 0.05, 0], [0.1, -0.05, 0], [-0.1, -0.05, 0.0]])
    to_sight = EstimateToSight(SightConfig(), camera, Region(58.0, 29.0), outline)
    assert to_sight.ego(State(1.0, 2.0, 0.0, 1.0), np.ones(6), 0.1).tolist() == [0.0] * 4


@pytest.mark.wide
def test_a_pose_out_of_reach_is_not_reached():
    import mujoco

    from sim.camera.camera import CameraConfig
    from sim.kinematics.inverse_kinematics import reach
    from sim.kinematics.robot import Robot
    from sim.models.assembly import build_model
    from sim.robots import arm
    from sim.targets import car

    target = car.Config().build(np.random.default_rng(0))
    design = arm.Config().build(np.random.default_rng(0))
    model = build_model(480.0, CameraConfig(), design, target)
    far = Pose(np.diag([1.0, -1.0, -1.0]), np.array([9.0, 9.0, 9.0]))
    assert reach(Robot(model, design), mujoco.MjData(model), far).there is False


@pytest.mark.parametrize(
    ("platform", "asked", "found"),
    [
        ("darwin", "", "glfw"),
        ("linux", " OSMesa ", "osmesa"),
    ],
)
def test_other_systems_and_libraries_render_too(monkeypatch, platform, asked, found):
    machine_with(monkeypatch, "libOSMesa.so.8")
    monkeypatch.setattr(gl.sys, "platform", platform)
    monkeypatch.setenv(gl.CHOSEN_BY, asked)
    assert gl.backend() == found


def test_an_empty_window_has_no_texture():
    labels = TextureBins(8, 10.0).label(np.zeros((9, 9, 3), np.uint8), Window(4, 4, 4, 8))
    assert labels.shape == (4, 0)


def test_a_camera_is_a_source():
    assert source_of("camera:7", 15.0).name == "camera:7"


@pytest.fixture
def broken(monkeypatch, tmp_path):
    """A study of two runs that fail."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(
        'scenario = "still"\nseeds = 2\n[axes]\nrun.latency = [0]\n'
    )

    def fail(job, folder):
        raise ValueError("no")

    monkeypatch.setattr(Job, "run", fail)
    return "mine.toml", (), None, 1, None, Path("out"), True


def test_runs_that_finish_when_they_are_tried_again_are_told(monkeypatch, tmp_path, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(
        'scenario = "still"\nseeds = 2\n[set]\nrun.duration = 0.1\ntracker.kind = "frozen"\n'
        "[axes]\nrun.latency = [0]\n"
    )
    real = Job.run

    def fail(job, folder):
        raise ValueError("now and then")

    monkeypatch.setattr(Job, "run", fail)
    arguments = "mine.toml", (), None, 1, None, Path("out"), False
    assert sweep_command.run(*arguments) == 1
    monkeypatch.setattr(Job, "run", real)
    capfd.readouterr()
    assert sweep_command.run(*arguments) == 0
    out, err = capfd.readouterr()
    assert (
        "servobench: out/failures: 2 of the runs failed first and finished when tried again: "
        "a component in them does not give the same result each time\n"
    ) in err
    assert (
        "No run reaches the time measure.after: measures from this time on have no value.\n" in out
    )


def test_failed_runs_are_told_with_their_last_line(broken, capfd):
    assert sweep_command.run(*broken) == 1
    lines = capfd.readouterr().err.splitlines()
    found = [Path("out/failures") / f"{n:06}.json" for n in range(2)]
    assert lines == [f"servobench: {found[0]}: ValueError: no (the first of 2 such runs)"]
    kept = json.loads(found[1].read_text())
    assert kept["error"].endswith("ValueError: no\n")
    assert "servobench run still" in kept["command"]
    assert not [*Path("out").glob("*.parquet"), *Path("out").glob("*.csv")]  # no run, no tables


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([True, False], pa.bool_()),
        ([1, 2], pa.int64()),
        ([1, 2.5], pa.float64()),
        (["a", 1], pa.string()),
        ([True, 1], pa.string()),
    ],
)
def test_a_column_has_the_type_of_its_values(values, kind):
    records = [
        Record(subject="mine", seed=0, settings={"x": value}, outcome="", success=True, measures={})
        for value in values
    ]
    assert record_file.table_of([records])["x"].type == kind


def test_too_many_runs_of_one_command_are_refused():
    from servo.study.execute import MOST_RUNS, check_number

    check_number(MOST_RUNS)
    with pytest.raises(Mistake) as refused:
        check_number(MOST_RUNS + 1)
    assert (
        str(refused.value)
        == "this command would make 100,001 runs; the limit is 100,000: make fewer at a time"
    )


@pytest.mark.parametrize(
    ("suite", "asked", "labels"),
    [
        ("listed", None, ["nothing"]),
        ("listed", "kams,sok", ["kams", "sok"]),
        ("plain", "sok", ["sok"]),
        ("plain", None, general_kinds()),
    ],
)
def test_a_bench_takes_the_trackers_asked_for_else_those_listed_else_all(
    suite, asked, labels, tmp_path, monkeypatch
):
    from servo.cli import evaluate_command

    def labels_of(jobs, *_):
        return [job.subject.contender.label for job in jobs]

    monkeypatch.setattr(evaluate_command, "print_estimate", labels_of)
    text = '[[sequences]]\nkind = "clutter"\n'
    if suite == "listed":
        text += '[[trackers]]\nkind = "frozen"\nlabel = "nothing"\n'
    (tmp_path / "s.toml").write_text(text)
    subjects = evaluate_command.subjects_of(str(tmp_path / "s.toml"), asked)
    assert [s.contender.label for s in subjects] == labels


def test_a_scenario_of_a_study_is_a_file_only_by_its_ending(monkeypatch, tmp_path):
    """A folder with a file named like a shipped scenario; a file that is not there."""
    from servo.study.parse import load

    (tmp_path / "still").write_text("not TOML")
    (tmp_path / "own.toml").write_text("[run]\nduration = 1.0\n")
    study = tmp_path / "mine.toml"
    study.write_text('scenario = ["still", "own.toml"]\n')
    assert [base.name for base in load(str(study)).bases] == ["still", str(tmp_path / "own.toml")]
    study.write_text('scenario = "gone.toml"\n')
    monkeypatch.chdir("/")
    with pytest.raises(Mistake) as refused:
        load(str(study))
    assert str(refused.value).startswith(
        "mine.toml: scenario: gone.toml: cannot read this scenario"
    )


def test_a_full_disk_is_said_without_a_file_where_none_is_named():
    found = Failure.of(OSError(errno.ENOSPC, "No space left on device"))
    assert (found.mistake, found.full) == ("No space left on device", True)
    with_file = Failure.of(OSError(errno.ENOSPC, "No space left on device", "a"))
    assert with_file.mistake == "a: No space left on device"


def test_the_reason_of_an_error_is_the_last_message_of_its_causes():
    above, below = RuntimeError("above"), ValueError()
    above.__cause__ = below
    assert reason(above) == "above"
    below.__cause__ = OSError(errno.ENOSPC, "No space left on device", "there")
    assert reason(above) == "No space left on device"
    assert reason(ValueError()) == "ValueError"


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("can't start new thread")])
def test_too_little_memory_ends_a_study_instead_of_failing_every_run(tmp_path, error):
    with pytest.raises(Refused) as told:
        Store(tmp_path).fail(Job(0, SimpleNamespace(name="mine"), 0), Failure.of(error))
    assert str(told.value).startswith(f"{tmp_path}: there is too little memory, or too few ")
    assert str(told.value).endswith(
        "the finished runs are stored; remove the cause and run the same command again to continue"
    )


@pytest.mark.usefixtures("no_progress")
def test_a_check_without_memory_is_no_mistake_of_the_user(monkeypatch, capfd):
    def run(job, folder):
        raise MemoryError

    monkeypatch.setattr(Job, "run", run)
    assert check_command.run(["still"], (), 0, 1, 1, quiet=True) == 1
    assert capfd.readouterr().err == (
        "servobench: there is too little memory, or too few processes are allowed (ulimit -a) "
        "(MemoryError) (still)\n"
    )
