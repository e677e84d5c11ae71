"""Verdicts of an interval on a claim: it holds, it does not hold, or it is undecided."""

from enum import Enum

from tracking.statistics.comparisons import Interval


class Finding(Enum):
    """Verdict on a claim: it holds, it does not hold, or it is undecided; the value is the sentence
    for users.
    """

    HOLDS = "holds: the whole interval is on the claim's side of the bound"
    DOES_NOT_HOLD = "does not hold: the whole interval is on the other side of the bound"
    UNDECIDED = (
        "undecided: the interval contains the bound, or there are too few units for an interval"
    )


def not_worse(difference: Interval, margin: float) -> Finding:
    """Return the verdict on the claim that the first of two methods is as good as the second up to
    a margin, by the confidence interval of their difference (test of non-inferiority): it holds if
    the interval is below the margin, does not hold if it is above, and is else undecided.

    Piaggio and others, Reporting of noninferiority and equivalence randomized trials, 2012.

    Args:
        difference: The first minus the second of a measure where lower is better, such as an error;
            the second minus the first where higher is better.
        margin: Largest difference that counts as equally good, in the measure's unit.
    """
    if difference.high < margin:
        return Finding.HOLDS
    return Finding.DOES_NOT_HOLD if difference.low > margin else Finding.UNDECIDED


def greater(value: Interval, bound: float) -> Finding:
    """Return the verdict on the claim that a value is above a bound, by its confidence interval
    (test of superiority): it holds if the interval is above the bound, does not hold if it is
    below, and is else undecided.

    >>> greater(Interval(0.4, 0.1, 0.7), 0.0).name
    'HOLDS'
    """
    if value.low > bound:
        return Finding.HOLDS
    return Finding.DOES_NOT_HOLD if value.high < bound else Finding.UNDECIDED
