"""Writes the longest test of each file in which one takes a second or more, from outputs of pytest.

Run `pytest -m "not processes" --durations=0 --durations-min=1 > FILE` in a fresh clone, then `python
tests/tools/durations.py FILE...`. The workers begin with the files that have the longest tests, so
that none has a long one left at the end.
"""

import json
import re
import sys
from pathlib import Path

WRITTEN = Path(__file__).parents[1] / "data" / "durations.json"
LINE = re.compile(r"^([\d.]+)s (?:call|setup) +tests/(\w+)\.py::", re.MULTILINE)
LEAST = 1.0
"""Shorter tests do not matter at the end [s]."""


def main(outputs: list[str]) -> None:
    """Read the outputs, and replace what was written before."""
    longest: dict[str, float] = {}
    for output in outputs:
        for seconds, file in LINE.findall(Path(output).read_text()):
            longest[file] = max(longest.get(file, 0.0), float(seconds))
    kept = {file: longest[file] for file in sorted(longest) if longest[file] >= LEAST}
    WRITTEN.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
