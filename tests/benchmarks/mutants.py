"""Whether the tests notice a random defect:

    uv run --extra dev python tests/benchmarks/mutants.py --seed 7 --count 60

Draws COUNT places in sim, tracking and servo by SEED, changes one operator, comparison, number,
truth or result at a time in a copy of the project, and runs the tests that can notice it. One line
a mutant goes to the terminal: noticed, and by which test, or survived; the survivors come last.

- Those of `-m wide` count, too: CI runs them; those of `-m processes` do not, as each takes seconds.
- The first run tests all once under coverage, to learn which test runs which line (on two cores
  some minutes); after a change of tests only these. Map and results are kept in FOLDER; the same
  command on the same tree goes on where it was stopped.
- A mutant runs the tests that run its line, the quick ones first, until one fails; where the line
  runs at import (defaults of settings, constants), those that run or import its file. Beyond 90 s
  in all the slowest tests are left out: what only they notice counts as survived. Compiled loops
  (tracking/loops, raster, shadows) are compiled anew.
- Each kind of change is as likely as the others, else half of all mutants would be numbers.
- Look at every survivor. Write the test that notices the kind of defect, or delete code that does
  nothing. Only a mutant that provably computes the same goes into MUTANTS_THAT_CHANGE_NOTHING.

cosmic-ray and mutmut do not serve: neither draws by seed; cosmic-ray runs all tests for each
mutant, in the checkout itself; mutmut changes no class body and no decorated (compiled) function.
"""

import argparse
import hashlib
import json
import random
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from mutant_map import PACKAGES, Map, digests
from mutant_runs import COMPILED, ROOT, Copy
from mutant_sites import KINDS, Site, sites

MUTANTS_THAT_CHANGE_NOTHING: dict[tuple[str, str, int, str, str], str] = {
    (
        "servo/report/words.py",
        'return f"{value:,.0f}" if 100 <= abs(value) < 1e6 else f"{value:.3g}"',
        34,
        "<=",
        "<",
    ): "100 has three digits",
    (
        "tracking/sequences/painted/camouflage.py",
        "cv2.ellipse(place, centre, half, turn, 0, 360, (1,), -1)",
        60,
        "1",
        "2",
    ): "what is above 0 is gravel",
    (
        "tracking/exported/toolkits.py",
        "answer = type(given)([type(points[0])(*corner) for corner in outline])",
        46,
        "0",
        "1",
    ): "the four corners are of one type",
    (
        "servo/papers/kams_paper.py",
        'drawn |= {f"layer {m}, over without": i for m, i in zip(layers, over_still, strict=True)}',
        87,
        "True",
        "False",
    ): "both have an element for each column of `after`",
    (
        "servo/controllers/_pending_commands.py",
        "return [(t * f, share) for (t, share), f in zip(coming, factors, strict=True)]",
        80,
        "True",
        "False",
    ): "there is a factor for each command under way",
    (
        "servo/papers/texture_paper.py",
        "return dict(zip(places, 1 - distances.T**2, strict=True))",
        55,
        "True",
        "False",
    ): "the distances are computed for each place",
}
"""Reviewed: (file, code of the line, column, old, new) -> why every result stays the same."""


@dataclass(frozen=True)
class Mutant:
    """A site with one of its alternatives."""

    site: Site
    new: str
    code: str
    """The line as it is."""

    @property
    def key(self):
        """What identifies it while lines move."""
        return self.site.file, self.code, self.site.column, self.site.old, self.new

    def __str__(self):
        old, new = (" ".join(text.split()) for text in (self.site.old, self.new))
        return f"{self.site.file}:{self.site.line}  [{old}] -> [{new}]  in: {self.code}"


def drawn(seed):
    """All mutants in an order that the seed decides, each kind as likely as the others."""
    by_kind: dict[str, list[Site]] = {kind: [] for kind in KINDS}
    texts = {}
    for path in sorted(path for part in PACKAGES for path in (ROOT / part).rglob("*.py")):
        file = path.relative_to(ROOT).as_posix()
        texts[file] = path.read_text()
        for site in sites(file, texts[file]):
            by_kind[site.kind].append(site)
    rng = random.Random(seed)
    while any(by_kind.values()):
        kind = rng.choice([kind for kind in KINDS if by_kind[kind]])
        site = by_kind[kind].pop(rng.randrange(len(by_kind[kind])))
        code = texts[site.file].splitlines()[site.line - 1].strip()
        yield Mutant(site, rng.choice(site.new), code)


def tried(mutant, copy, known):
    """Runs the tests on one mutant: how it ended, as a row of the results."""
    site = mutant.site
    row = {"key": mutant.key, "line": site.line, "kind": site.kind}
    tests, expected = known.tests(site)
    if not tests:
        return row | {"noticed": False, "by": "no test runs this line", "seconds": 0.0}
    began = time.monotonic()
    with copy.mutated(site, mutant.new):
        verdict = copy.noticed(tests, expected, compiled=site.file.startswith(COMPILED))
    seconds = round(time.monotonic() - began, 1)
    by = verdict or f"none of {len(tests)} tests"
    return row | {"noticed": verdict is not None, "by": by, "seconds": seconds}


def results(seed, count, folder):
    """Rows of the first mutants of a seed, those of an earlier run from its file."""
    copy = Copy(folder)
    copy.make()
    known = Map.of(copy)
    if known.failed:
        say(f"left out, as they do not pass without a mutant: {', '.join(known.failed)}")
    tree = hashlib.sha256(json.dumps(digests(ROOT)).encode()).hexdigest()[:12]
    kept = folder / f"{tree}-seed-{seed}.jsonl"
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    done = {tuple(row["key"]): row for row in rows}
    counted = 0
    for mutant in drawn(seed):
        if counted == count:
            return
        if reason := MUTANTS_THAT_CHANGE_NOTHING.get(mutant.key):
            say(f"   not counted  {mutant}\n                {reason}")
            continue
        row = done.get(mutant.key) or tried(mutant, copy, known)
        if mutant.key not in done:
            with kept.open("a") as file:
                file.write(json.dumps(row) + "\n")
        counted += 1
        word = "noticed " if row["noticed"] else "SURVIVED"
        say(f"{counted:3d} {word}  {mutant}\n                {row['seconds']} s, {row['by']}")
        yield mutant, row


def say(line):
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main():
    parser = argparse.ArgumentParser(description="Whether the tests notice a random defect.")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--count", type=int, default=60)
    default = Path(tempfile.gettempdir()) / "servobench-mutants"
    parser.add_argument("--folder", type=Path, default=default, help="by default %(default)s")
    asked = parser.parse_args()
    folder = asked.folder.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    ended = list(results(asked.seed, asked.count, folder))
    survivors = [(mutant, row) for mutant, row in ended if not row["noticed"]]
    minutes = (time.monotonic() - began) / 60
    noticed = len(ended) - len(survivors)
    say(f"\nseed {asked.seed}: {noticed} of {len(ended)} noticed, in {minutes:.0f} minutes")
    for mutant, row in survivors:
        say(f"survived: {mutant} ({row['by']})")


if __name__ == "__main__":
    main()
