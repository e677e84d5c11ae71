"""What a tracker compiles is compiled before its time counts."""

import importlib
import pkgutil

import pytest

from servo.loop.episode import Episode
from servo.scenario.load import load
from tracking import loops
from tracking.evaluation.warm_up import warm_up
from tracking.types import Status


def compiled():
    """Return which variants of each loop are compiled in this process."""
    names = [m.name for m in pkgutil.iter_modules(loops.__path__)]
    modules = [importlib.import_module(f"{loops.__name__}.{name}") for name in names]
    return {
        (name, str(signature))
        for module in modules
        for name, loop in vars(module).items()
        for signature in getattr(loop, "signatures", ())
    }


@pytest.mark.parametrize("kind", ["kams", "mk_ssd", "texture_pf", "pf_ssd", "mk_pf", "hybrid"])
def test_nothing_is_left_to_compile_once_a_tracker_has_started(kind):
    scenario = load("line", [f"tracker.kind={kind}", "run.duration=0.2"])
    warm_up(scenario.tracker)
    with Episode(scenario) as episode:
        before = compiled()
        list(episode)
    assert compiled() == before
    assert before


def test_a_run_by_measured_time_warms_its_tracker_up(monkeypatch):
    seen = []
    monkeypatch.setattr("servo.loop.episode.warm_up", seen.append)
    for takes in ("measured", "30"):
        scenario = load("still", [f"run.tracker_ms={takes}", "run.duration=0.1"])
        with Episode(scenario):
            pass
    assert [type(config) for config in seen] == [type(load("still").tracker)]


def test_a_tracker_that_fails_is_no_mistake_of_the_warm_up():
    class Fails:
        def build(self, rng):
            raise ValueError("no")

    assert warm_up(Fails()) == []
    shots = warm_up(load("still").tracker)
    assert [shot.estimate.status for shot in shots][-1] is Status.LOST
