"""`servobench budget`: sources of error, their settings, and what follows from runs."""

from pathlib import Path

import numpy as np
import pytest

from servo.budget.plan import NOTHING, TOGETHER, Part, Plan
from servo.budget.sources import SOURCES, coarser, magnitudes_of, theory
from servo.cli import budget_command
from servo.cli.idle_settings import idle_settings
from servo.loop.episode import Episode
from servo.mistake import Mistake
from servo.report.budget_section import picture, sentence, table
from servo.scenario.load import load
from servo.study.run import Job, Record
from servo.study.trials import trial_study

OF = {source.name: source for source in SOURCES}
POSE = ("robot.kind=free", "tracker.kind=truth", "tracker.corners=true", "features.kind=pose")
POSE += ("estimator.kind=none", "run.duration=2", "controller.gain=5")


def plan_of(scenario, *changes, **magnitudes):
    base, _ = trial_study("budget", scenario, changes, "")
    return Plan.of(base, range(1, 3), magnitudes)


def test_each_seed_draws_a_direction_of_the_stated_length():
    drawn = [OF["mount_rotation"].settings(0.5, seed) for seed in (1, 2, 1)]
    turns = [one["believed.hand_eye_rotation_deg"] for one in drawn]
    assert turns[0] == turns[2] != turns[1]
    assert np.linalg.norm(turns, axis=1) == pytest.approx(0.5)
    assert abs(OF["focal_length"].settings(2.0, 1)["believed.fx_factor"] - 1) == pytest.approx(0.02)
    assert OF["play"].settings(3.0, 1) == {"robot.backlash": pytest.approx(0.003)}


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("noise", {"camera.noise": 7.0}),
        ("delay", {"run.latency_ms": 7.0}),
        ("lag", {"robot.lag_ms": 7.0}),
        ("play", {"robot.backlash": 0.007}),
        ("encoder_step", {"robot.encoder_step": 0.007}),
        ("focal_length", {"believed.fx_factor": 1.07}),
        ("principal_point", {"believed.cx_shift": 4.2, "believed.cy_shift": 5.6}),
        ("mount_rotation", {"believed.hand_eye_rotation_deg": [2.0, -3.0, 6.0]}),
        ("mount_translation", {"believed.hand_eye_mm": [6.0, 3.0, -2.0]}),
        ("depth", {"believed.depth_factor": 0.93}),
        ("target_size", {"believed.size_factor": 1.07}),
    ],
)
def test_a_magnitude_of_7_is_in_its_unit(name, wrong):
    """Settings are in m and rad, as factors or in the unit of their name; magnitudes in mm, mrad,
    ms, deg, px or %. Several numbers are a vector of this length."""

    def off(settings):
        return np.linalg.norm(
            [np.linalg.norm(np.subtract(settings[key], OF[name].ideal[key])) for key in wrong]
        )

    plan = plan_of("still", *(f"{key}={value}" for key, value in wrong.items()))
    assert plan.own[name] == pytest.approx(7.0)
    assert OF[name].own(plan.base.parsed(1, plan.settings((), 1))) == 0.0
    assert off(OF[name].settings(7.0, 1)) == pytest.approx(off(wrong))


def test_nothing_wrong_is_an_ideal_scenario():
    plan = plan_of("line", "run.tracker_ms=20")
    ideal = plan.settings((), 1)
    assert ideal["tracker.kind"] == "truth"
    assert ideal["believed.fx_factor"] == 1.0
    assert ideal["run.latency_ms"] == ideal["run.tracker_ms"] == 0.0
    every = plan.settings(SOURCES, 1)
    assert "tracker.kind" not in every
    assert "run.latency_ms" not in every  # the scenario's own
    assert every["camera.width"] == 160
    plan.base.parsed(1, ideal)
    plan.base.parsed(1, every)


def test_a_coarser_picture_leaves_errors_in_pixels_as_large_in_the_scene():
    plan = plan_of("line", principal_point=4.0)
    alone, together = plan.settings((OF["principal_point"],), 1), plan.settings(SOURCES, 1)
    for key in ("believed.cx_shift", "believed.cy_shift"):
        assert together[key] == pytest.approx(alone[key] / 2)


def test_delays_beside_the_latency_are_those_of_the_scenario_or_none():
    late = "run.tracker_ms=100", "run.jitter_ms=40", "believed.clock_offset_ms=50"
    plan = plan_of("line", "run.latency=0", *late)
    assert plan.own["delay"] == 100.0
    ideal = {"run.tracker_ms": 0.0, "run.jitter_ms": 0.0, "believed.clock_offset_ms": 0.0}
    assert ideal.items() <= plan.settings((), 1).items()
    assert not ideal.keys() & plan.settings((OF["delay"],), 1).keys()
    stated = plan_of("line", *late, delay=33.0)
    assert ideal.items() <= stated.settings((OF["delay"],), 1).items()


def test_a_delay_in_the_file_is_replaced():
    plan = plan_of("latency_3", delay=50.0)
    assert plan.base.parsed(1, plan.settings((), 1)).run.latency_ms == 0.0
    assert plan.base.parsed(1, plan.settings((OF["delay"],), 1)).run.latency_ms == 50.0
    assert plan.words(OF["delay"]) == "50 ms (stated)"
    assert plan_of("latency_3").words(OF["delay"]) == "100 ms (the scenario's)"
    assert plan_of("latency_3").words(OF["lag"]) == "30 ms (usual)"


def test_a_coarser_picture_shows_the_same():
    settings = coarser(load("six_hybrid", ["start.x=8"]), 2.0)
    assert settings["camera.fx"] == 300.0
    assert settings["camera.width"] == 320
    assert settings["start.x"] == 4.0


@pytest.mark.parametrize(
    ("changes", "source", "reason"),
    [
        ((), "play", ""),
        (("tracker.kind=truth",), "noise", "the tracker sees no pictures"),
        (("tracker.kind=truth",), "tracker", "the tracker knows the truth"),
        (('believed.goal="shown"',), "target_size", "size_factor has no effect"),
        (
            ("tracker.kind=tag", "target.kind=tag", "features.kind=pose"),
            "depth",
            "depth_factor has no",
        ),
    ],
)
def test_sources_that_a_scenario_cannot_have_are_named(changes, source, reason):
    def idle(scenario):
        with Episode(scenario, seen=False) as episode:
            return idle_settings(episode)

    found = plan_of("still", *changes).reason(OF[source], idle)
    assert reason in found
    assert bool(reason) == bool(found)


def test_a_believed_size_counts_for_a_law_on_pixels_only_where_it_is_taken():
    lens = ["camera.distortion=fisheye", "camera.coefficients=[0.0,0,0,0]"]
    for changes, is_idle in (([], True), (lens, False)):
        scenario = load("photometric", ["believed.size_factor=1.1", *changes])
        with Episode(scenario, seen=False) as episode:
            found = " ".join(idle_settings(episode))
        assert ("believed.size_factor" in found) == is_idle


@pytest.mark.parametrize(
    ("changes", "is_idle"),
    [([], True), (["tracker.kind=homography"], False)],
)
def test_the_border_of_weighted_corners_counts_where_the_tracker_reports_corners(changes, is_idle):
    scenario = load("plate_line", ["features.kind=weighted", "features.border=0.2", *changes])
    with Episode(scenario, seen=False) as episode:
        found = " ".join(idle_settings(episode))
    assert ("features.border" in found) == is_idle


@pytest.mark.parametrize(
    ("changes", "is_idle"),
    [([], True), (['sight.plane="known"'], False), (['sight.depth="known"'], False)],
)
def test_the_height_of_the_table_counts_where_something_is_known_from_it(changes, is_idle):
    scenario = load("plate_line", ["features.kind=points", "sight.table_height=0.01", *changes])
    with Episode(scenario, seen=False) as episode:
        found = " ".join(idle_settings(episode))
    assert ("sight.table_height" in found) == is_idle


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("focal=1", "--magnitude focal=1: there is no source of error 'focal'; there is noise"),
        ("tracker=1", "there is no source of error 'tracker'"),
        (
            "play=much",
            "--magnitude play=much: write play=NUMBER, with a number of at least 0 [mm, mrad]",
        ),
        ("play=-1", "at least 0"),
        ("resolution=0.5", "at least 1"),
        ("play", "at least 0"),
    ],
)
def test_wrong_magnitudes_are_a_sentence(text, sentence):
    with pytest.raises(Mistake) as error:
        magnitudes_of([text])
    assert sentence in str(error.value)


def test_theory_is_that_of_a_wrong_calibration():
    still = load("still", ["goal.depth=0.8"])
    assert theory(OF["focal_length"], 1.0, still, 600.0) == pytest.approx(8.0)
    assert theory(OF["principal_point"], 3.0, still, 600.0) == 0.0
    posed = load("still", ["goal.depth=0.8", "believed.goal=pose"])
    assert theory(OF["principal_point"], 3.0, posed, 600.0) == pytest.approx(4.0)
    measured = load("depth_plate", ["motion.kind=still"])
    assert theory(OF["focal_length"], 1.0, measured, 600.0) == 0.0
    assert theory(OF["target_size"], 1.0, measured, 600.0) == 0.0
    assert theory(OF["lag"], 3.0, still, 600.0) == 0.0
    assert theory(OF["lag"], 3.0, load("line"), 600.0) is None
    assert theory(OF["noise"], 3.0, still, 600.0) is None
    assert theory(OF["focal_length"], 1.0, load("hand_follow"), 600.0) is None


@pytest.mark.wide
@pytest.mark.parametrize("name", ["focal_length", "target_size", "mount_translation"])
def test_simulation_ends_where_theory_says(name):
    plan = plan_of("still", *POSE)
    cells = (), plan.alone(OF[name])
    ends = [
        Job(0, plan.base, 1, plan.settings(wrong, 1)).run(Path()).measures["end_position_mm"]
        for wrong in cells
    ]
    expected = theory(OF[name], plan.magnitude(OF[name]), plan.scenario, 300.0)
    assert ends[0] < 0.2
    assert ends[1] == pytest.approx(expected, rel=0.03, abs=0.3)


def record(mm, px):
    """A run whose error in the picture is px in its last second, root mean square."""
    errors = np.array([50.0, 50.0, 1.4 * px, 0.2 * px])
    series = {"time_s": np.array([0.0, 1.95, 2.05, 3.0]), "servo_error_px": errors}
    measures = {"end_position_mm": mm, "end_rotation_deg": 0.0}
    return Record(
        subject="s", seed=0, outcome="CONVERGED", success=True, measures=measures, series=series
    )


def test_contributions_are_what_a_source_adds():
    plan = plan_of("still")
    sources = [OF["tracker"], OF["noise"], OF["lag"]]
    ends = [(3.0, 0.0), (5.0, 0.0), (13.0, 0.0), (3.0, 4.0), (13.0, 4.0)]
    records = [record(*end) for end in ends for _ in plan.seeds]
    records[0] = None  # one that failed
    parts = plan.parts(sources, records, 300.0)
    assert [part.name for part in parts] == [NOTHING, "tracker", "noise", "lag", TOGETHER]
    assert [part.error[0] for part in parts] == pytest.approx([3, 4, 12, 0, 13])
    assert [part.success for part in parts] == ["1 of 2", *["2 of 2"] * 4]
    said = sentence(parts)
    assert (
        said
        == "At the end 13 mm (3 with nothing wrong), of which the noise is 12 and the tracker is 4; 0 deg; 4 px, of which the lag is 4."
    )
    assert table(parts).rows[-2][2] == "13"
    assert len(picture(parts).keys) == 4
    with pytest.raises(Mistake, match="every run of the budget's row 'nothing wrong' fails"):
        plan.parts(sources, [None] * 10, 300.0)


def part(name, mm):
    return Part(name, "", np.array([mm, 0.0, 0.0]), None, "1 of 1")


def test_the_three_largest_parts_are_named_if_they_are_above_a_fifth_of_the_whole():
    sizes = {"noise": 2.1, "play": 2.3, "lag": 2.2, "depth": 2.4}
    parts = [part(NOTHING, 2.1), *(part(*pair) for pair in sizes.items()), part(TOGETHER, 10.0)]
    begin = "At the end 10 mm (2.1 with nothing wrong), of which the depth is 2.4 and the play is "
    assert sentence(parts) == f"{begin}2.3 and the lag is 2.2; 0 deg; 0 px."
    parts = [part(NOTHING, 1.9), part("noise", 1.9), part("play", 2.1), part(TOGETHER, 10.0)]
    assert sentence(parts) == "At the end 10 mm, of which the play is 2.1; 0 deg; 0 px."


def test_a_part_of_a_bar_that_is_too_thin_to_be_seen_has_no_key():
    """The shares of a bar are of squares; one needs 0.3 %."""
    shares = {"noise": 0.0029, "play": 0.0031, "lag": 0.994}
    parts = [part(name, share**0.5) for name, share in shares.items()]
    keys = picture([part(NOTHING, 0.0), *parts, part(TOGETHER, 1.0)]).keys
    assert [key.label for key in keys] == ["play", "lag"]


def test_parts_are_not_larger_than_the_whole():
    said = sentence(
        [part(NOTHING, 0.0), part("focal_length", 6.0), part("depth", 8.0), part(TOGETHER, 5.0)]
    )
    assert (
        said == "At the end 5 mm, of which the depth is 4 and the focal length is 3; 0 deg; 0 px."
    )


def test_the_command_writes_a_page_and_plots(tmp_path):
    changes = (*POSE, "run.duration=0.2")
    options = {"magnitude": (), "seeds": 1, "workers": 1, "scheduler": None, "quiet": True}
    budget_command.run(scenario="still", changes=changes, out=tmp_path, **options)
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {"budget.json", "budget.png", "budget.svg", "report.html"}
    assert "Left out" in (tmp_path / "report.html").read_text()


def test_a_budget_says_how_large_each_source_is_and_where_that_is_from():
    plan = plan_of("still", "camera.noise=2", lag=12.345)
    words = [plan.words(source) for source in SOURCES]
    assert words == [
        "pf_ssd",
        "2 grey levels (the scenario's)",
        "2 times coarser (usual)",
        "33.3 ms (the scenario's)",
        "12.3 ms (stated)",
        "1 mm, mrad (usual)",
        "0.1 mm, mrad (usual)",
        "1 % (usual)",
        "3 px (usual)",
        "0.5 deg (usual)",
        "3 mm (usual)",
        "10 % (usual)",
        "1 % (usual)",
    ]


def test_a_magnitude_may_be_0_and_a_picture_as_fine_as_it_is():
    assert magnitudes_of(["lag=0", "resolution=1"]) == {"lag": 0.0, "resolution": 1.0}
    coarse = "resolution=NUMBER, with a number of at least 1 [times coarser]"
    late = "lag=NUMBER, with a number of at least 0 [ms]"
    for text, form in (
        ("lag=-0.1", late),
        ("resolution=0.9", coarse),
        ("lag=inf", late),
        ("lag=x", late),
    ):
        with pytest.raises(Mistake) as refused:
            magnitudes_of([text])
        assert str(refused.value) == f"--magnitude {text}: write {form}"
