"""The numbers that people build on stay what they are: scenarios, motions, estimates, tracks.

The values lie in tests/data/approved; conftest.py says how they are changed on purpose.
"""

from typing import Literal, get_args, get_origin, get_type_hints

import cv2
import numpy as np
import pytest
from servoing import begun

from servo import estimators
from servo.estimators import KINDS as ESTIMATORS
from servo.scenario.catalogue import LISTS, PLUGINS, shipped
from servo.scenario.load import load
from servo.types import OwnMotion
from sim import disturbances, motions
from sim.disturbances import KINDS as DISTURBANCES
from sim.motions import KINDS as MOTIONS
from sim.types import Frame
from tracking.sequences.painted import KINDS as GENERATORS
from tracking.trackers import KINDS as TRACKERS
from tracking.trackers import general_kinds
from tracking.types import Region, State

FOLDERS = [*(folder for folder, _ in PLUGINS.values()), *LISTS.values(), GENERATORS]
KINDS = general_kinds()
PRESETS = [(kind, name) for kind in KINDS for name in ("", *TRACKERS.presets(kind))]
ROUNDING = 1e-4
"""Other processors round otherwise: a track may differ by this share."""


def build(folder, kind, seed=0, **settings):
    return folder.config_of(kind)(**settings).build(np.random.default_rng(seed))


def test_every_shipped_scenario_means_this(approved):
    def meaning(scenario):
        return scenario.settings() | {"expect": scenario.expect}

    approved("scenarios", {name: meaning(load(name)) for name in shipped()})


def test_every_motion_goes_this_way(approved):
    found = {}
    for kind in MOTIONS.names():
        poses = [build(motions.KINDS, kind).at(t) for t in (0.0, 0.7, 1.9, 3.3, 6.1, 11.0)]
        found[kind] = [[*p.translation[:2], *p.rotation[:2, 0]] for p in poses]
    approved("motions", found)


def test_every_disturbance_has_these_effects(approved):
    times = (0.3, 1.2, 2.1, 2.9, 3.1, 3.4, 4.6, 5.2, 6.3, 9.0)
    every = DISTURBANCES.names()
    approved(
        "disturbances",
        {kind: [build(disturbances.KINDS, kind).at(t) for t in times] for kind in every},
    )


def test_every_estimator_gives_these_estimates(approved):
    """A target that drives, brakes and is hidden for four frames, with noise; at two rates."""
    found = {}
    for kind in ESTIMATORS.names():
        for rate in (30, 5):
            estimator, rng = begun(build(estimators.KINDS, kind)), np.random.default_rng(2)
            error, rows = np.zeros(4), []
            for k in range(30):
                own = OwnMotion(rng.normal(0, 0.05, 4), rng.normal(0, 0.05, (k % 3, 4)))
                speed = np.array([0.1, -0.2, 0.02, 0.1]) * (1.0 if k < 15 else -0.4)
                error = error + (speed + own.past) / rate
                seen = error + rng.normal(0, 2e-3, 4)
                hidden = 20 <= k < 24
                rows.append(
                    estimator.skip(own, 1 / rate)
                    if hidden
                    else estimator.update(seen, own, 1 / rate)
                )
            found[f"{kind} at {rate} Hz"] = rows[1::4] + rows[22:23]
    approved("estimates", found)


@pytest.mark.newest
def test_every_generator_paints_these_sequences(approved):
    found = {}
    for kind in GENERATORS.names():
        sequence = build(GENERATORS, kind, 2)
        pictures = [sequence.source.paint(k) for k in (0, 17, 80)]
        found[kind] = {
            "states": None if sequence.states is None else sequence.states[::12],
            "truth": sequence.truth[::25],
            "size": pictures[0].shape,
            "colours": [p.reshape(-1, 3).mean(axis=0) for p in pictures],
            "pixels": [p[::40, ::40].reshape(-1, 3) for p in pictures],
        }
    approved("sequences", found, ROUNDING)


def film(count=9):
    """A car of four colours drives, turns and comes nearer over a smooth ground, with noise."""
    rng = np.random.default_rng(3)
    ground = cv2.GaussianBlur(rng.integers(40, 150, (120, 160, 3)).astype(np.uint8), (0, 0), 2)
    for k in range(count):
        image, (x, y), turn = ground.copy(), (60 + 2.5 * k, 62 - k), 0.3 + 0.03 * k
        c, s = np.cos(turn), np.sin(turn)
        for left, top, colour in (
            (-20, -10, (30, 60, 220)),
            (0, -10, (200, 40, 60)),
            (-20, 0, (240, 240, 60)),
            (0, 0, (20, 160, 90)),
        ):
            box = (1 + 0.012 * k) * (np.array([[0, 0], [20, 0], [20, 10], [0, 10]]) + (left, top))
            points = box @ np.array([[c, s], [-s, c]]) + (x, y)
            cv2.fillConvexPoly(image, np.round(points).astype(int), colour)
        noisy = np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
        noisy.setflags(write=False)
        yield Frame(noisy, k / 30, k)


def track(kind, settings):
    """What a tracker says of the film, a row a picture; it is told of the camera at every third."""
    tracker = build(TRACKERS, kind, 7, **settings)
    first, *frames = film()
    tracker.start(first, Region(40.0, 20.0), State(60.0, 62.0, 0.3, 1.0))
    ego = np.array([0.5, -0.5, 0.002, 0.001])
    rows = []
    for frame in frames:
        e = tracker.update(frame, ego if frame.index % 3 == 0 else None)
        rows.append(
            [
                *e.state.vector,
                *np.diag(e.covariance),
                e.distance,
                e.ess,
                e.evaluations,
                e.status,
                e.follows,
            ]
        )
    return rows


@pytest.mark.parametrize(("kind", "preset"), PRESETS, ids=["-".join(p).strip("-") for p in PRESETS])
def test_every_tracker_goes_this_way(approved, kind, preset):
    settings = TRACKERS.presets(kind)[preset] if preset else {}
    approved(f"tracks/{kind}{'-' * bool(preset)}{preset}", track(kind, settings), ROUNDING)


@pytest.mark.parametrize("kind", KINDS)
def test_every_choice_of_a_tracker_goes_this_way(approved, kind):
    """Each word that a setting may have, and each switch the other way round."""
    config, others = TRACKERS.config_of(kind), {}
    for name, hint in get_type_hints(config).items():
        before = getattr(config(), name)
        if get_origin(hint) is Literal:
            others |= {f"{name}={w}": {name: w} for w in get_args(hint) if w != before}
        elif isinstance(before, bool):
            others[f"{name}={not before}"] = {name: not before}
    rows = {said: track(kind, changes)[::3] for said, changes in others.items()}
    approved(f"tracks/choices-{kind}", rows, ROUNDING)
