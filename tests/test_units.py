"""What the intervals and tests of a study are over."""

from servo.study import results
from servo.study.results import Units
from tracking.statistics.comparisons import McNemar


def rows(*held):
    """Rows of a study: (tracker, latency, seed, success, rms)."""
    names = ("tracker.kind", "run.latency", "seed", "success", "servo_rms_px")
    return [dict(zip(names, one, strict=True)) for one in held]


def clustered(*at):
    """Rows of (scenario, tracker, seed, success, rms)."""
    return [
        row | {"scenario": scenario}
        for scenario, *rest in at
        for row in rows((rest[0], 0, *rest[1:]))
    ]


def test_a_study_of_scenarios_has_as_many_units_as_scenarios():
    found = clustered(
        *(
            (f"s{k}", tracker, seed, seed < 2 or tracker == "a", 1.0 + k + seed)
            for k in range(6)
            for tracker in "ab"
            for seed in range(4)
        )
    )
    axes = ["scenario", "tracker.kind", "run.latency"]
    of_b = Units.of([r for r in found if r["tracker.kind"] == "b"], axes, drawn=True)
    assert (of_b.name, of_b.mean("success").units, of_b.mean("success").value) == (
        "scenario",
        6,
        0.5,
    )
    (pair,) = results.comparisons("tracker.kind", axes, found, drawn=True)
    assert (pair.first, pair.unit, pair.test) == ("a", "scenario", McNemar(6, 0, 0))


def test_seeds_that_draw_nothing_are_one_observation():
    alike = rows(*(("frozen", 0, s, True, 1.5) for s in range(10)))
    axes = ["tracker.kind", "run.latency"]
    for row, time in zip(alike, range(10), strict=True):
        row["step_ms"] = row["track_ms"] = float(time)
    found = Units.of(alike, axes, drawn=False)
    assert (found.name, found.mean("servo_rms_px").units) == ("run", 1)
    assert not found.mean("servo_rms_px").known
    assert Units.of(alike, axes, drawn=True).mean("success").units == 10
    other = rows(*(("kams", 0, s, False, 2.0) for s in range(10)))
    (pair,) = results.comparisons("tracker.kind", axes, alike + other)
    assert (pair.unit, pair.test) == ("run", McNemar(1, 0, 0))
    other[3]["servo_rms_px"] = 2.5
    (pair,) = results.comparisons("tracker.kind", axes, alike + other)
    assert (pair.unit, pair.test) == ("seed", McNemar(10, 0, 0))
