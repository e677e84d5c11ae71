"""The mutants that tests/benchmarks/mutants.py draws from: which there are, and which are not."""

from types import SimpleNamespace

import pytest

CODE = '''"""Never 1 + 1."""
from typing import Annotated, TYPE_CHECKING
if TYPE_CHECKING:
    import numpy as n1
__all__ = ["a", 1]

@numba.njit(cache=True)
def f(x: Annotated[int, Le(9)] = 2) -> int:
    """Says 3 < 4."""
    print(f"{x + 1}", "é" + "b")
    if x is not None and not x:
        return -x ** 2
    while 0 <= x < (  # of the rest
        5
    ):
        x += 1.5
    return None

@option(default=2)
def g():
    pass
'''


@pytest.fixture
def mutant_sites(root, monkeypatch):
    monkeypatch.syspath_prepend(root / "tests" / "benchmarks")
    import mutant_sites

    return mutant_sites


def test_sites_are_where_something_is_computed(mutant_sites):
    found = [(s.kind, s.line, s.old, s.new, s.inside) for s in mutant_sites.sites("f.py", CODE)]
    assert found == [
        ("number", 8, "2", ("3",), False),
        ("truth", 11, "x is not None and not x", ("not (x is not None and not x)",), True),
        ("truth", 11, "is not", ("is",), True),
        ("truth", 11, "and", ("or",), True),
        ("truth", 11, "not", ("   ",), True),
        ("arithmetic", 12, "-", (" ",), True),
        ("result", 12, "-x ** 2", ("None",), True),
        ("arithmetic", 12, "**", ("*",), True),
        ("number", 12, "2", ("3",), True),
        ("number", 13, "0", ("1",), True),
        ("comparison", 13, "<=", ("<", ">", ">="), True),
        ("comparison", 13, "<", ("<=", ">=", ">"), True),
        ("number", 14, "5", ("6",), True),
        ("arithmetic", 16, "+=", ("-=",), True),
        ("number", 16, "1.5", ("2.25", "2.5"), True),
        ("number", 19, "2", ("3",), False),
    ]


def test_a_mutant_differs_in_one_place_and_is_still_python(mutant_sites):
    for site in mutant_sites.sites("f.py", CODE):
        for new in site.new:
            changed = mutant_sites.mutated(CODE, site, new)
            pairs = zip(CODE.splitlines(), changed.splitlines(), strict=True)
            assert [k for k, (a, b) in enumerate(pairs, 1) if a != b] == [site.line]


def test_what_must_run_is_the_statement_up_to_the_place(mutant_sites):
    lines = {s.old: s.lines for s in mutant_sites.sites("f.py", CODE)}
    assert lines["5"] == (13, 14)
    assert lines["1.5"] == (16, 16)


def test_a_run_of_the_tests_that_ends_early_is_no_map(root, monkeypatch, tmp_path):
    pytest.importorskip("coverage")
    monkeypatch.syspath_prepend(root / "tests" / "benchmarks")
    import mutant_map

    copy = SimpleNamespace(folder=tmp_path, root=root, pytest=lambda *_, **__: 2)
    with pytest.raises(SystemExit) as ended:
        mutant_map.measure(copy, ["tests/test_dof.py"])
    assert str(ended.value) == (
        f"no map of the tests: pytest ended early (exit code 2): {tmp_path}/output.txt says why; "
        "mend it and run the same command again"
    )
