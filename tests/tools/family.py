"""Which verdicts of the papers' claims stay if they are corrected for their number: python tests/tools/family.py.

Each claim that holds is tested against its bound, one-sided: the distance of the effect from the bound over the standard
error that its 95 % interval has on that side; of ratios in logarithms. Claims that do not hold count with p = 1. Holm
(1979) corrects for all. A claim of several parts is tested by the effect that its table shows.
"""

import json
import re
import sys
from pathlib import Path

import numpy as np
from scipy.stats import norm

from tracking.statistics.comparisons import holm

VERDICTS = Path("servo/papers/verdicts.json")
ABOVE = {
    "P0-1a": 0.0,
    "P0-5": 0.0,
    "P1-1": 0.0,
    "P1-5a": 90.0,
    "P1-5b": 90.0,
    "P1-7": 50.0,
    "P1-8": 0.0,
    "P2-2": 90.0,
    "P3-1": 0.1,
    "P3-4": 0.0,
    "P3-6": 20.0,
    "P3-1b": 0.1,
    "P3-4b": 0.0,
    "P3-6b": 20.0,
}
"""Bounds of effects that must be larger."""
BELOW = {"P1-2": 0.3, "P1-6a": 2.0, "P1-6b": 1.0, "P1-9": 0.0, "P3-3": 15.0, "P3-5": 15.0}
"""Bounds of effects that must be smaller."""
RATIOS = {
    "P0-3": 1.0,
    "P1-3": 2.0,
    "P1-4a": 5.0,
    "P1-4b": 5.0,
    "P1-10a": 1.5,
    "P1-10b": 1.5,
    "P1-12a": 2.0,
    **dict.fromkeys(("P1-13a", "P1-13b", "P1-14a", "P1-14b", "P1-15a", "P1-15b"), 1.1),
    "P2-3b": 1.0,
}
"""Bounds of ratios; that of P0-3 must be smaller."""
UNTESTED = {"P0-2", "estimators"}
"""Their rules count what is completed or kept; no interval decides them."""
Z = norm.ppf(0.975)


def p_value(name: str, effect: str) -> float:
    """Return the one-sided p value of a claim that holds."""
    found = re.search(r"^([-\d.]+) .*\(([-\d.]+) to ([-\d.]+)\)$", effect)
    assert found is not None
    value, low, high = (float(part) for part in found.groups())
    bound = {**ABOVE, **BELOW, **RATIOS}[name]
    if name in RATIOS:
        value, low, high, bound = np.log([value, low, high, bound])
    error = (value - low if value > bound else high - value) / Z
    with np.errstate(divide="ignore"):  # an interval that is zero wide in the printed digits
        return float(norm.sf(np.float64(abs(value - bound)) / error))


def main() -> None:
    """Print the corrected p value of each claim that holds, the largest last."""
    verdicts = json.loads(VERDICTS.read_text())
    names = [name for name in verdicts if name not in UNTESTED]
    p = [p_value(n, verdicts[n][1]) if verdicts[n][0] == "holds" else 1.0 for n in names]
    corrected = dict(zip(names, holm(np.array(p)), strict=True))
    for name in sorted(names, key=lambda n: corrected[n]):
        if verdicts[name][0] == "holds":
            sys.stdout.write(f"{name:8} {corrected[name]:.2g}\n")


if __name__ == "__main__":
    main()
