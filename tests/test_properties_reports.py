"""Folders of results that are damaged anywhere: a page or one sentence, never a traceback."""

import copy
import json
import random
import shutil
import sys

import numpy as np
import pytest

from servo.cli import main
from servo.cli.report_command import write
from servo.mistake import Mistake

ODD = (None, 3, -1.5, "x", [], {}, [[]], [None], {"a": None}, True, 1e308, "\ufffd", ["x"])
AT_THE_TOP, BELOW, EACH = 6, 3, 1
"""Places that are changed in a file, near its top and anywhere below, and how often each."""
QUICK = ("run.duration=0.2", "tracker.kind=frozen", "estimator.kind=none", "expect={}")
KINDS = {
    "run": ("run", "still", "--no-rerun", *(w for s in QUICK for w in ("--set", s))),
    "bench": ("evaluate", "clutter", "--trackers", "frozen,mean_shift", "--seeds", "1"),
    "sweep": ("sweep", "mine.toml"),
    "papers": ("papers", "P1-3", "--quick"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory, finished_study):
    """One folder of each kind, made when it is first asked for."""
    there = tmp_path_factory.mktemp("made")
    shutil.copytree(finished_study, there / "sweep")

    def make(kind):
        if not (there / kind).exists():
            words = [*KINDS[kind], *(() if kind == "run" else ("--workers", "1"))]
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(sys, "argv", ["servobench", *words, "--out", str(there / kind), "-q"])
                with pytest.raises(SystemExit):
                    main.main()
        return there / kind

    return make


def places(value, at=()):
    yield at
    if isinstance(value, dict):
        for key in value:
            yield from places(value[key], (*at, key))
    elif isinstance(value, list):
        for i in range(min(len(value), 2)):
            yield from places(value[i], (*at, i))


def changed(value, at, new):
    if not at:
        return new
    value = copy.copy(value)
    value[at[0]] = changed(value[at[0]], at[1:], new)
    return value


def sentence(folder, tmp_path):
    """Whether there is a page, or a sentence that says which folder is damaged."""
    try:
        return write([folder], tmp_path / "page.html")[0].stat().st_size > 1000
    except Mistake as error:
        return str(folder) in str(error)


@pytest.fixture
def damaged(made, tmp_path):
    def copied(kind):
        shutil.copytree(made(kind), tmp_path / kind)
        return tmp_path / kind

    return copied


@pytest.mark.parametrize("kind", KINDS)
def test_any_value_of_a_json_file_may_be_another_one(damaged, kind, tmp_path):
    folder, draw = damaged(kind), random.Random(0)
    for path in sorted(folder.rglob("*.json"))[:3]:
        good = path.read_text()
        every = sorted(places(json.loads(good)), key=len)
        below = every[AT_THE_TOP:]
        for at in every[:AT_THE_TOP] + draw.sample(below, min(BELOW, len(below))):
            for odd in draw.sample(ODD, EACH):
                path.write_text(json.dumps(changed(json.loads(good), at, odd)))
                assert sentence(folder, tmp_path), (path.name, at, odd)
        path.write_text(good)


@pytest.mark.parametrize("kind", ["run", "sweep"])
def test_any_bit_of_a_table_may_be_flipped(damaged, kind, tmp_path):
    folder, draw = damaged(kind), np.random.default_rng(0)
    pages = set()
    files = {"run": "steps.parquet", "sweep": "runs.sqlite"}
    for path in folder.rglob(files[kind]):
        raw = path.read_bytes()
        pages.add(write([folder], tmp_path / "page.html")[0].read_text())
        for at in draw.integers(len(raw), size=3).tolist():
            path.write_bytes(raw[:at] + bytes([raw[at] ^ 0x10]) + raw[at + 1 :])
            assert sentence(folder, tmp_path), (path.name, at)
        path.write_bytes(raw)
    assert len(pages) == 1
