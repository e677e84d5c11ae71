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
