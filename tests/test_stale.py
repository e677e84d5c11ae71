"""`tests/tools/stale.py` tells which results are older than the code that they measure."""

import os
import subprocess
from itertools import count
from pathlib import Path

import stale

ROOT = Path(__file__).parents[1]
PAGE = "# Results\n\n## One\n\n| px |\n|---|\n| 1 |\n\nText.\n\n## Other\n\n2 px.\n"
LAW = 'def law(error):\n    """Return a command."""\n    return 2 * error\n'


def test_every_page_section_and_path_of_the_table_is_there():
    for page, depends in stale.MEASURED.items():
        titles = {
            line.lstrip("# ") for line in (ROOT / page).read_text().splitlines() if "#" in line
        }
        assert set(depends) - {stale.REST} <= titles, page
        paths = {path for part in depends.values() for path in part}
        assert [path for path in sorted(paths) if not list(ROOT.glob(path))] == []


def test_a_section_is_stale_if_the_code_that_it_measures_changed_after_its_tables(tmp_path):
    days = count()

    def commit(**texts):
        for name, text in texts.items():
            (tmp_path / name.replace("_", ".")).write_text(text)
        who = ["-c", "user.name=a", "-c", "user.email=a@b"]
        dated = os.environ | {"GIT_COMMITTER_DATE": f"2026-01-{next(days) + 1:02}T12:00:00Z"}
        for words in (["add", "."], [*who, "commit", "-qm", "a"]):
            subprocess.run(["git", "-C", tmp_path, *words], check=True, env=dated)
        stale.git.cache_clear()
        stale.code.cache_clear()
        return list(stale.report(tmp_path, {"page.md": {stale.REST: ("law.py",)}}))

    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    assert commit(page_md=PAGE, law_py=LAW) == ["page.md"]
    assert commit(law_py=LAW.replace("a command", "the command") + "# Why.\n") == ["page.md"]
    both = commit(law_py=LAW.replace("2", "3"))
    assert [line.split(" (")[0] for line in both[1:]] == ["  One", "  Other"]
    assert "(2026-01-01, " in both[1]
    assert both[1].endswith("): 1 of 1 files have changed: law.py")
    # New text is a new measurement where a section has no table, and is none where it has one.
    again = commit(page_md=PAGE.replace("Text", "New text").replace("2 px", "3 px"))
    assert [line.split(" (")[0] for line in again[1:]] == ["  One"]
