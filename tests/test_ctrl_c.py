"""Ctrl-C means the same to every command, at any moment: one line, and exit code 130."""

import os
import signal
import sys

import pytest
from commands import STOPPED, begin, ended, wait_for, workers_of

from servo.cli import list_command, main


def test_a_command_that_does_nothing_about_it(monkeypatch, capfd):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(list_command, "shipped", interrupted)
    monkeypatch.setattr(sys, "argv", ["servobench", "list"])
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert (ended.value.code, *capfd.readouterr()) == (130, "", f"{STOPPED}\n")


@pytest.mark.parametrize("results", [0, 1])
def test_a_bench_whose_workers_still_start_or_are_at_work(tmp_path, results):
    words = "bench clutter --trackers sok --seeds 300 --workers 2 --out out --quiet"
    bench = begin(words, tmp_path)
    wait_for(lambda: len(workers_of(bench)) == 2)
    wait_for(lambda: len(list(tmp_path.rglob("results/**/*.json"))) >= results)
    os.killpg(bench.pid, signal.SIGINT)  # as a terminal does: to everybody
    assert ended(bench) == (130, f"{STOPPED} The same command goes on from there.\n")
    assert not (tmp_path / "out" / "table.csv").exists()  # of half the runs it would mislead
