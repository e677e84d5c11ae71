"""Runs a scenario to its end for tests, and measures the run."""

from servo.loop.episode import Episode
from servo.loop.run_measures import summarise


def measured_run(scenario, each=None, kept=None):
    """Run a scenario to its end, and return its steps without pictures, and its measures.

    Args:
        scenario: Settings of the run.
        each: Called with every step, which still has its picture; None: nothing is called.
        kept: As for `Episode`.
    """
    steps = []
    with Episode(scenario, seen=each is not None, kept=kept) as episode:
        for step in episode:
            if each is not None:
                each(step)
            steps.append(step.light())
    return steps, summarise(steps, scenario.measure, 1 / scenario.camera.rate)
