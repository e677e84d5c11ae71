import numpy as np
import pytest

from tracking.evaluation.statistics import McNemar, bootstrap, holm

# The five z of Naeem, Pridmore and Mills, table 1, decode to these counts over 36 sequences.
PAPER = {
    "condensation": (15, 2, 19, 2.910428),
    "mean shift": (31, 1, 4, 5.126524),
    "annealing": (19, 1, 16, 3.801316),
    "hybrid": (28, 1, 7, 4.828079),
    "SOK": (24, 4, 8, 3.590662),
}


@pytest.mark.parametrize("against", PAPER)
def test_the_papers_z_scores(against):
    wins, losses, ties, z = PAPER[against]
    assert wins + losses + ties == 36
    assert McNemar(wins, losses, ties).z == pytest.approx(z, abs=5e-7)


@pytest.mark.parametrize("against", PAPER)
def test_each_decodes_to_one_pair_of_counts_only(against):
    wins, losses, _, z = PAPER[against]
    fitting = [
        (w, n)
        for w in range(37)
        for n in range(min(w, 36 - w) + 1)
        if abs(McNemar(w, n).z - z) < 1e-6
    ]
    assert fitting == [(wins, losses)]


@pytest.mark.parametrize(
    ("wins", "losses", "significant"),
    [(6, 0, True), (5, 0, False), (8, 1, True), (7, 1, False), (13, 4, True), (12, 4, False)],
)
def test_the_exact_test_at_five_percent(wins, losses, significant):
    assert (McNemar(wins, losses).p < 0.05) is significant


def test_no_difference_is_no_evidence():
    same = McNemar.of(np.array([3.0, 5.0]), np.array([3.0, 5.0]))
    assert (same.wins, same.losses, same.ties, same.z, same.p) == (0, 0, 2, 0.0, 1.0)


def test_counts_come_from_paired_scores():
    first, second = np.array([140.0, 90.0, 10.0, 7.0]), np.array([30.0, 90.0, 40.0, 1.0])
    assert McNemar.of(first, second) == McNemar(2, 1, 1)


def test_the_bootstrap_covers_the_true_difference_as_often_as_it_says():
    rng, covered = np.random.default_rng(0), 0
    for _ in range(200):
        common = rng.normal(0, 3, 40)
        first, second = common + rng.normal(1.0, 1, 40), common + rng.normal(0, 1, 40)
        interval = bootstrap(first - second, rng, confidence=0.9, draws=500)
        covered += interval.low <= 1.0 <= interval.high
    # 200 trials at 0.9 have a standard deviation of 4.2; the percentile interval is a little short.
    assert 165 <= covered <= 195


def test_the_bootstrap_refuses_nothing_to_draw_from():
    with pytest.raises(ValueError, match="an interval needs at least one score"):
        bootstrap(np.zeros(0), np.random.default_rng())


def test_holm_steps_down_and_never_falls():
    np.testing.assert_allclose(
        holm(np.array([0.01, 0.04, 0.03, 0.005])), [0.03, 0.06, 0.06, 0.02], atol=1e-12
    )
    np.testing.assert_allclose(holm(np.array([0.9, 0.8])), [1.0, 1.0])
