import numpy as np
import pytest

from tracking.statistics.comparisons import (
    Interval,
    McNemar,
    difference_of_shares,
    holm,
    mean_of,
    mean_percent,
)

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


SIGMA = 0.5
SCORES = {
    "normal": (lambda rng, shape: rng.normal(size=shape), 0.0),
    "uniform": (lambda rng, shape: rng.uniform(size=shape), 0.5),
    "exponential": (lambda rng, shape: rng.exponential(size=shape), 1.0),
    "lognormal": (lambda rng, shape: rng.lognormal(0, SIGMA, shape), np.exp(SIGMA**2 / 2)),
    "lognormal, sigma 1": (lambda rng, shape: rng.lognormal(0, 1, shape), np.exp(0.5)),
}
TRIALS = 2000


def coverage(intervals, true):
    return np.mean([i.low <= true <= i.high for i in intervals])


@pytest.mark.parametrize("units", [10, 30])
@pytest.mark.parametrize("name", SCORES)
def test_intervals_of_means_cover_as_often_as_they_say(name, units):
    draw, true = SCORES[name]
    scores = draw(np.random.default_rng(units), (TRIALS, units))
    found = coverage(map(mean_of, scores), true)
    # 2000 trials at 0.95 have a standard deviation of 0.5 %. What is as skewed as the last one is
    # covered too seldom: no interval that we tried does better (the bootstrap's 80 to 91 %).
    least = {10: 0.87, 30: 0.915}[units] if name.endswith("sigma 1") else 0.925
    assert least <= found <= 0.975


@pytest.mark.parametrize("units", [10, 30])
def test_intervals_of_shares_cover_on_average_over_the_true_share(units):
    rng = np.random.default_rng(units)
    true = rng.uniform(0.05, 0.95, TRIALS)
    found = [mean_of((rng.random(units) < share) * 1.0, least=0.0, most=1.0) for share in true]
    covered = [i.low <= share <= i.high for i, share in zip(found, true, strict=True)]
    assert 0.93 <= np.mean(covered) <= 0.97


@pytest.mark.parametrize(("first", "second", "most"), [(0.3, 0.1, 0.995), (0.1, 0.05, 1.0)])
def test_intervals_of_differences_of_shares_cover_at_least_as_often_as_they_say(
    first, second, most
):
    found = []
    for rng in np.random.default_rng(3).spawn(TRIALS):
        only = rng.choice(3, 10, p=[first, second, 1 - first - second])
        found.append(difference_of_shares((only != 1) * 1.0, (only != 0) * 1.0))
    assert 0.93 <= coverage(found, first - second) <= most


def test_an_interval_is_that_of_student_where_nothing_is_skewed():
    interval = mean_of(np.array([1.0, 2.0, 3.0]))
    reach = 4.302653 / np.sqrt(3)  # the 97.5 % quantile of t with two degrees of freedom
    assert interval == Interval(2.0, pytest.approx(2 - reach), pytest.approx(2 + reach), 3)
    skewed = mean_of(np.array([1.0, 1.0, 1.0, 5.0]))
    assert skewed.high - 2.0 > 2.0 - skewed.low


def test_no_interval_reaches_beyond_what_a_score_can_be():
    interval = mean_of(np.array([0.9, 1.0, 0.7]), least=0.0, most=1.0)
    assert (interval.low > 0, interval.high) == (True, 1.0)


@pytest.mark.parametrize(
    ("scores", "low", "high"),
    [
        ([2.5], np.nan, np.nan),
        ([1.0, np.nan], np.nan, np.nan),
        ([3.0, 3.0], 3.0, 3.0),
        ([0.1, 0.1, 0.1], 0.1, 0.1),
        ([1.0] * 10, 10 / (10 + 1.959964**2), 1.0),
        ([0.0, 0.0], 0.0, 1 - 2 / (2 + 1.959964**2)),
    ],
)
def test_what_has_no_spread_has_this_interval(scores, low, high):
    share = len(scores) > 1 and set(scores) <= {0.0, 1.0}
    found = mean_of(np.array(scores), **({"least": 0.0, "most": 1.0} if share else {}))
    assert found.units == len(scores)
    assert found.known == np.isfinite(low)
    np.testing.assert_allclose([found.low, found.high], [low, high], atol=1e-6)
    with pytest.raises(ValueError, match="a mean with an interval needs at least one score"):
        mean_of(np.zeros(0))


def test_a_measure_that_happens_to_be_0_or_1_is_no_share():
    assert mean_of(np.array([0.0, 0.0, 0.0]), least=0.0) == Interval(0.0, 0.0, 0.0, 3)
    seconds = mean_of(np.array([0.0, 1.0, 1.0, 0.0]), least=0.0)
    assert seconds.high == pytest.approx(0.5 + 3.182446 * (1 / 3) ** 0.5 / 2)  # Student's t


def test_a_percentage_of_frames_has_wilsons_interval_in_percent():
    none, some = mean_percent(np.zeros(3)), mean_percent(np.array([0.0, 1.0, 1.0]))
    assert (none.low, none.high) == (0.0, pytest.approx(56.1497, abs=1e-3))
    assert 0 < some.low < some.value < some.high < 100


def test_equal_shares_are_no_proof_that_all_are_so():
    found = mean_of(np.full(2, 0.75), least=0.0, most=1.0)
    np.testing.assert_allclose([found.low, found.high], [0.1979, 0.9733], atol=1e-4)  # Wilson


def test_one_unit_is_no_evidence_of_a_difference_of_shares():
    found = difference_of_shares(np.ones(1), np.zeros(1))
    assert (found.value, found.known, found.units) == (1.0, False, 1)


def test_holm_steps_down_and_never_falls():
    np.testing.assert_allclose(
        holm(np.array([0.01, 0.04, 0.03, 0.005])), [0.03, 0.06, 0.06, 0.02], atol=1e-12
    )
    np.testing.assert_allclose(holm(np.array([0.9, 0.8])), [1.0, 1.0])
