import numpy as np
import pytest

from tracking.statistics.comparisons import Interval
from tracking.statistics.verdicts import Finding, greater, not_worse

HOLDS, DOES_NOT_HOLD, UNDECIDED = Finding


@pytest.mark.parametrize(
    ("low", "high", "as_good", "more"),
    [
        (-1.0, 0.29, HOLDS, DOES_NOT_HOLD),
        (-1.0, 0.3, UNDECIDED, UNDECIDED),
        (0.3, 2.0, UNDECIDED, UNDECIDED),
        (0.31, 2.0, DOES_NOT_HOLD, HOLDS),
        (-2.0, -1.0, HOLDS, DOES_NOT_HOLD),
        (np.nan, np.nan, UNDECIDED, UNDECIDED),
    ],
)
def test_a_finding_needs_the_whole_interval_on_one_side(low, high, as_good, more):
    assert not_worse(Interval(0.1, low, high), margin=0.3) is as_good
    assert greater(Interval(0.1, low, high), bound=0.3) is more
