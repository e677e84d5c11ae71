"""Writes the tests that take half a second or more, from outputs of pytest.

Run `pytest -m "not processes" --durations=0 --durations-min=0.5 > FILE` in a fresh clone, the same
with `-m processes`, then `python tests/tools/durations.py FILE...`. By what it writes, the plain
command leaves out the longest tests, and the workers begin with the files that have the longest
ones, so that none has a long one left at the end.
"""

import json
import re
import sys
from pathlib import Path

WRITTEN = Path(__file__).parents[1] / "data" / "durations.json"
LINE = re.compile(r"^([\d.]+)s (?:call|setup) +tests/(\w+)\.py::(.+)$", re.MULTILINE)
LEAST = 0.5
"""Shorter tests are not written [s]."""


def main(outputs: list[str]) -> None:
    """Read the outputs, and replace what was written before."""
    longest: dict[str, dict[str, float]] = {}
    for output in outputs:
        for found, file, test in LINE.findall(Path(output).read_text()):
            seconds = round(float(found), 1)
            if seconds >= LEAST:
                of_file = longest.setdefault(file, {})
                of_file[test] = max(of_file.get(test, 0.0), seconds)
    WRITTEN.write_text(json.dumps(longest, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
