"""Hundreds of wrong inputs, of every command: each ends in one sentence and exit code 2, and leaves
every file as it was. They are lines of `tests/inputs/*.toml`; the folder is that of `hostile.py`.
"""

import os
import shlex
import sys
import tomllib
from pathlib import Path

import hostile
import pytest
from wordings import LISTED, folded

from servo.cli import main

LISTS = sorted((Path(__file__).parent / "inputs").glob("*.toml"))
CASES = {
    f"{path.stem}: {line}": (line, sentence)
    for path in LISTS
    for line, sentence in tomllib.loads(path.read_text(encoding="utf-8")).items()
}
USAGE = "Error: "
"""How the last line of click's own mistakes begins."""


@pytest.fixture(scope="session")
def place(tmp_path_factory, ran, finished_study, make_papers):
    papers = make_papers(tmp_path_factory.mktemp("papers") / "out")
    return hostile.place(tmp_path_factory.mktemp("hostile"), ran, finished_study, papers)


@pytest.fixture(scope="session")
def last(place):
    """What was in the folder after the last command."""
    return [state(place)]


def state(folder):
    """All that is in a folder: names, sizes, and when they were changed."""
    found = {}
    for at, folders, files in os.walk(folder):
        for name in folders + files:
            status = os.lstat(os.path.join(at, name))  # noqa: PTH118  (thousands)
            found[at, name] = (status.st_mode, status.st_size, status.st_mtime_ns)
    return found


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_input_ends_in_one_sentence_and_writes_nothing(
    monkeypatch, capfd, place, last, case
):
    line, sentence = CASES[case]
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(place)
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(sys, stream, getattr(sys, stream))  # a command puts its own there
    words = [hostile.spelled(word) for word in shlex.split(line)]
    monkeypatch.setattr(sys, "argv", ["servobench", *words])
    with pytest.raises(SystemExit) as ended:
        main.main()
    out, err = capfd.readouterr()
    said = err.splitlines()
    if not said[-1].startswith(USAGE):
        assert len(said) == 1
        assert said[0].startswith("servobench: ")
    assert folded(said[-1].removeprefix("servobench: ")) == sentence
    assert (ended.value.code, out.strip()) == (2, "")
    before, last[0] = last[0], state(place)
    assert last[0] == before


def test_the_list_has_inputs_of_every_command():
    lines = [line for line, _ in CASES.values()]
    assert len(lines) >= 700
    assert {line.split()[0] for line in lines} >= set(main.app.commands)
    assert all(words not in sentence for _, sentence in CASES.values() for words in LISTED.values())
