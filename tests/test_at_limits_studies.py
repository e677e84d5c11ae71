"""Each limit of studies and commands: the last value that passes, and the first that does not."""

from collections import Counter
from types import SimpleNamespace

import pytest

from servo.cli import sweep_command
from servo.mistake import LONGEST, Mistake, Refused
from servo.report import words
from servo.scenario import toml
from servo.scenario.draws import LARGEST_NUMBER
from servo.study import parse
from servo.study.cluster import local as local_cluster
from servo.study.cluster import tasks as cluster
from servo.study.plan import MOST_VALUES, axes_of
from servo.study.run import ClusterLost
from servo.study.sequence_run import LONGEST_LABEL, Contender


def passes(check, *arguments):
    """Whether a check lets this pass."""
    try:
        check(*arguments)
    except (Mistake, ValueError):
        return False
    return True


def test_a_sentence_is_cut_when_it_is_too_long():
    assert str(Mistake("x" * LONGEST)) == "x" * LONGEST
    assert str(Mistake("x" * (LONGEST + 1))) == f"{'x' * 1000} [...] {'x' * 1000}"


@pytest.mark.parametrize(("depth", "right"), [(20, True), (21, False)])
def test_tables_in_tables(depth, right):
    nested = 1
    for _ in range(depth):
        nested = [nested]
    assert passes(toml.check, nested, "here") is right


@pytest.mark.parametrize(
    ("value", "right"),
    [
        ((1 << 63) - 1, True),
        (1 << 63, False),
        (-(1 << 63), True),
        (-(1 << 63) - 1, False),
        (chr(0xD7FF), True),
        (chr(0xD800), False),
        (chr(0xDFFF), False),
        (chr(0xE000), True),
    ],
)
def test_values_of_toml(value, right):
    assert passes(toml.check, [value], "here") is right


@pytest.mark.parametrize(
    ("given", "right"),
    [
        (list(range(MOST_VALUES)), True),
        (list(range(MOST_VALUES + 1)), False),
        ({"linspace": [0, 1, MOST_VALUES]}, True),
        ({"linspace": [0, 1, MOST_VALUES + 1]}, False),
        ({"linspace": [0, 1, 1]}, True),
        ({"linspace": [0, 1, 0]}, False),
        ({"linspace": [0, 1, 2.0]}, False),
        ({"choice": [1]}, True),
        ({"uniform": [1, 1]}, True),
        ({"uniform": [1.01, 1]}, False),
        ({"uniform": [-LARGEST_NUMBER, LARGEST_NUMBER]}, True),
        ({"uniform": [0, 1.01 * LARGEST_NUMBER]}, False),
        ({"log_uniform": [1e-9, 1]}, True),
        ({"log_uniform": [0, 1]}, False),
        ({"geomspace": [1, 1e-9, 3]}, True),
        ({"geomspace": [1, 0, 3]}, False),
        ({"normal": [1, 0]}, True),
        ({"normal": [1, -0.01]}, False),
    ],
)
def test_axes(given, right):
    assert passes(axes_of, {"start": {"x": given}}, "mine.toml") is right


def without_scenarios(monkeypatch):
    """Skip the checks of each run's scenario, which take minutes for thousands of values."""
    monkeypatch.setattr(parse, "parse_scenario", lambda *_: None)


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("seeds = 1000000", True),
        ("seeds = 1000001", False),
        ("seeds = 0", False),
        ("seeds = 1", True),
        ("seeds = [0]", True),
        ("seeds = [-1]", False),
        ("seeds = [2, 2]", False),
        ("seeds = 100\naxes.start.x = { linspace = [0, 1, 10000] }", True),
        (
            "seeds = [0, 1, 2]\naxes.start.x = { linspace = [0, 1, 10000] }\n"
            "axes.start.y = { linspace = [0, 1, 34] }",
            False,
        ),
        ("expect.success_rate = 0", True),
        ("expect.success_rate = 1", True),
        ("expect.success_rate = -0.01", False),
        ("expect.success_rate = 1.01", False),
    ],
)
def test_studies(tmp_path, monkeypatch, text, right):
    without_scenarios(monkeypatch)
    (tmp_path / "mine.toml").write_text(f"scenario = 'still'\n{text}\n")
    assert passes(parse.load, str(tmp_path / "mine.toml")) is right


def test_seeds_of_the_command_line(tmp_path, monkeypatch):
    without_scenarios(monkeypatch)
    path = tmp_path / "mine.toml"
    path.write_text("scenario = 'still'\n")
    assert [passes(parse.load, str(path), (), n) for n in (1_000_000, 1_000_001)] == [True, False]


@pytest.mark.parametrize(
    ("label", "right"),
    [
        ("x", True),
        ("", False),
        ("x" * LONGEST_LABEL, True),
        ("x" * (LONGEST_LABEL + 1), False),
        (".x", False),
        ("x.", True),
        ("a/b", False),
        ("a\\b", False),
        (" a", False),
        ("a\n", False),
    ],
)
def test_labels(label, right):
    assert passes(Contender, label, None) is right


def machine_of(monkeypatch, memory, cores=2, files=(-1, -1)):
    """Let the machine have so many bytes, cores and open files."""
    monkeypatch.setattr(local_cluster, "MEMORY_LIMIT", memory)
    monkeypatch.setattr(local_cluster, "CPU_COUNT", cores)
    monkeypatch.setattr(local_cluster.resource, "getrlimit", lambda _: files)


@pytest.mark.parametrize(("memory", "most"), [(24e9, 16), (3 * 300e6, 3), (1e6, 1)])
def test_workers(monkeypatch, memory, most):
    machine_of(monkeypatch, memory)
    assert [passes(local_cluster.check_workers, n) for n in (most, most + 1)] == [True, False]


@pytest.mark.parametrize(
    ("soft", "hard", "outcome"),
    [
        (64, 64, []),
        (63, 64, [(64, 64)]),
        (63, 63, Refused),
        (-1, -1, []),
        (63, -1, [(64, -1)]),
    ],
)
def test_open_files(monkeypatch, soft, hard, outcome):
    """Two workers need 64: 32 of the client, 16 a worker."""
    set_to = []
    machine_of(monkeypatch, 24e9, files=(soft, hard))
    monkeypatch.setattr(local_cluster.resource, "setrlimit", lambda _, to: set_to.append(to))
    if outcome is Refused:
        with pytest.raises(Refused):
            local_cluster.check_workers(2)
    else:
        local_cluster.check_workers(2)
        assert set_to == outcome


@pytest.mark.parametrize(("threads", "right"), [({}, True), ({"a": 1}, True), ({"a": 2}, False)])
def test_threads_of_workers(threads, right):
    crew = cluster.Cluster(SimpleNamespace(nthreads=lambda: threads), "it", lambda _: None)
    if right:
        assert crew.workers() == len(threads)
    else:
        with pytest.raises(ClusterLost):
            crew.workers()


def test_numbers_on_a_page():
    assert [words.shown(x) for x in (1.92e-14, -4.59e-17, 1.5e-12)] == ["0", "0", "1.5e-12"]
    told = [words.shown(x) for x in (99.96, 100.0, 100.4, 999_999.0, 1e6, -1e6, -123.4)]
    assert told == ["100", "100", "100", "999,999", "1e+06", "-1e+06", "-123"]
    assert words.cut("runs", [1, 2], 2) is None
    assert words.cut("runs", [1, 2, 3], 2) == "The first 2 of 3 runs are shown."


def test_cells_of_a_printed_table(capsys):
    from rich.console import Console

    success = SimpleNamespace(value=1.0, low=1.0, high=1.0, units=1, known=True)
    cell = SimpleNamespace(
        settings={"a": 1}, runs=1, means={}, finite=Counter(), success=success, unit="seed"
    )
    for count, more in ((60, False), (61, True)):
        sweep_command._print_cells(Console(width=100), [cell] * count, [])
        assert ("... and 1 more rows in cells.csv" in capsys.readouterr().out) is more
