"""The command line: that stored with results repeats what was typed; what to begin with; the names
that a shell completes.
"""

import re
import shlex

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

from servo.cli.main import app
from servo.cli.options import TO_TRY
from servo.output.formats import command_line
from servo.scenario.toml import assignment
from servo.study.scenario_run import StudiedScenario


def test_a_command_line_repeats_what_was_typed():
    line = command_line("run", "my scenario.toml", set=["a=b c", "d=[1, 2]"], seed=0, out=None)
    assert shlex.split(line) == [
        "servobench",
        "run",
        "my scenario.toml",
        "--set",
        "a=b c",
        "--set",
        "d=[1, 2]",
        "--seed",
        "0",
    ]
    assert command_line("track", "-x.mp4", video=True, rerun=False, truth_format="otb") == (
        "servobench track --video --truth-format otb -- -x.mp4"
    )


VALUES = [
    1,
    2.5,
    True,
    "kams",
    "true",
    "inf",
    "2026-01-01",
    " a ",
    "a b",
    "it's",
    'a"b',
    "",
    "a\nb",
    "[1]",
    [0.5, 1],
    [[1], ["x"]],
    {"kind": "a", "at": [1, 2], "deep": {"b": "c d"}},
    [{"kind": "board", "start": 1e-7}],
    "x\u2028y",
    1e300,
]


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_a_value_of_a_study_is_the_same_after_set(value):
    base = StudiedScenario("still", {}, "still.toml")
    words = shlex.split(base.command(3, {"tracker.x": value}))
    assert words[:5] == ["servobench", "run", "still", "--seed", "3"]
    assert assignment(words[6]) == ("tracker.x", value)


def test_each_command_stands_once_in_the_help():
    shown = re.findall(r"^  (\w+)  ", CliRunner().invoke(app, []).output, re.MULTILINE)
    assert sorted(shown) == sorted(n for n, command in app.commands.items() if not command.hidden)


def test_five_commands_to_begin_with_stand_below_the_help():
    named = re.findall(r"^  servobench (\w+)", TO_TRY, re.MULTILINE)
    assert len(named) == 5
    assert {*named} <= app.commands.keys()
    assert CliRunner().invoke(app, []).output.endswith(TO_TRY)


@pytest.mark.parametrize(
    ("words", "begun", "found"),
    [
        (["run"], "rev", [("plain", "reversal"), ("plain", "reversal_5hz")]),
        (["check", "line"], "spi", [("plain", "spin")]),
        (["sweep"], "enc", [("plain", "encoder")]),
        (["run"], "mine/a", [("file", "mine/a")]),
        ([], "doc", [("plain", "docs"), ("plain", "doctor")]),
    ],
)
def test_a_shell_completes_so(words, begun, found):
    shell = ShellComplete(app, {}, "servobench", "_SERVOBENCH_COMPLETE")
    assert [(c.type, c.value) for c in shell.get_completions(words, begun)] == found


def numbers_of(command):
    """The options of a command that are numbers: default, least and largest."""
    found = {}
    for option in command.params:
        ends = getattr(option.type, "min", None), getattr(option.type, "max", None)
        given = option.default if type(option.default) in (int, float) else None
        if given is not None or ends != (None, None):
            found[option.name] = (given, *ends)
    return found


NATURAL, COUNT, WORKERS = (0, 0, None), (None, 1, None), (2, 1, None)
PORT, SPEED = (None, 1024, 65_534), (None, 0.01, 1000.0)
OF_TWIN = {
    "exposure_ms": (None, 0.0, 1000.0), "readout_ms": (None, 0.0, 1000.0), "tag_mm": (None, 1.0, 10000.0),
    "fov": (None, 1.0, 170.0), "along": (None, -10.0, 10.0), "rate": (30.0, 0.01, 10_000.0),
    "begins": (None, -1e10, 1e10),
}  # fmt: skip
NUMBERS = {
    "benchmark": {"workers": WORKERS},
    "budget": {"seeds": (8, 1, None), "workers": WORKERS},
    "check": {"seeds": (1, 1, None), "seed": NATURAL, "workers": WORKERS},
    "compare": {"seeds": (3, 1, None), "workers": WORKERS},
    "evaluate": {"seeds": (3, 1, None), "workers": WORKERS},
    "papers": {"first_seed": COUNT, "workers": WORKERS},
    "photo": {"side": (60.0, 5.0, 2000.0)},
    "preflight": OF_TWIN,
    "report": {"figure_width": (None, 2.0, 20.0)},
    "run": {"seed": (None, 0, None), "speed": SPEED, "port": PORT},
    "sweep": {"seeds": COUNT, "workers": WORKERS},
    "track": {
        "seed": NATURAL, "speed": SPEED, "port": PORT, "rate": (30.0, 0.01, 10_000.0),
        "frames": (None, 1, 1_000_000_000),
    },
    "tune": {
        "budget": (300, 1, None), "seeds": (8, 1, 1000), "fresh": (20, 1, None), "workers": WORKERS,
    },
    "twin": OF_TWIN,
    "view": {"port": PORT, "at": (4.0, 0.0, 3600.0)},
}  # fmt: skip


def test_what_is_typed_without_an_option_stays_the_same():
    """A default or a limit that changes makes a stored command give other results."""
    found = {name: numbers_of(app.get_command(None, name)) for name in app.list_commands(None)}
    assert {name: options for name, options in found.items() if options} == NUMBERS


def test_options_without_a_value_are_off_unless_they_are_typed():
    for name in app.list_commands(None):
        for option in app.get_command(None, name).params:
            if getattr(option, "is_flag", False):
                assert option.default is not True, (name, option.name)
