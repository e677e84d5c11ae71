"""The manuals: links lead somewhere, examples run, and tables name what there is."""

import dataclasses
import re
import tomllib
from pathlib import Path

import click
import pytest

from servo.cli.main import app
from servo.loop.run_measures import MEANINGS
from servo.scenario.catalogue import LISTS, PLUGINS, shipped, studies
from servo.scenario.load import KEYS, SECTIONS, parse
from tracking.sequences import painted as generators

ROOT = Path(__file__).parents[1]
FOLDERS = ("scenes", "servo", "sim", "tests", "tracking")
MANUALS = sorted([*ROOT.glob("*.md"), *(p for f in FOLDERS for p in (ROOT / f).rglob("*.md"))])
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

NAME = r"[A-Z][a-z]+(?:-[A-Z][a-z]+)?"
CITED = re.compile(
    rf"({NAME})(?:(?:,| and) {NAME}(?: [A-Z][a-z]+)?)*(?: et al\.)?,? ((?:19|20)\d\d)\b"
)
"""Such as "Isard and Blake 1998" or "Perez et al. 2002"."""


def name(path):
    return str(path.relative_to(ROOT))


def blocks(language):
    found = [(m, b) for m in MANUALS for of, b in BLOCK.findall(m.read_text()) if of == language]
    return [pytest.param(block, id=f"{name(m)}-{k}") for k, (m, block) in enumerate(found)]


def anchors(path):
    """What GitHub makes of the headings of a file."""
    prose = BLOCK.sub("", path.read_text())
    headings = re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


def broken(path):
    """Links of a file to files or headings that do not exist."""
    for target in re.findall(r"\]\(([^)\s]+)\)", BLOCK.sub("", path.read_text())):
        if not re.match(r"https?://", target):
            file, _, anchor = target.partition("#")
            at = (path.parent / file).resolve() if file else path
            if not at.exists() or (anchor and anchor not in anchors(at)):
                yield target


def commands_of(text):
    """Every command line of ours in a text: its words after `servobench`."""
    shown = [line for _, block in BLOCK.findall(text) for line in block.splitlines()]
    shown += re.findall(r"`([^`\n]+)`", BLOCK.sub("", text))
    for line in shown:
        found = re.match(r"(?:.*uv run |# )?servobench ([a-z-].*)", line)
        if found:
            yield found[1].partition(" # ")[0].split()


def test_there_is_a_manual_for_each_subject():
    folders = {".", "scenes", "tracking", "servo", "servo/papers", "tests/benchmarks"}
    assert {name(p.parent) for p in MANUALS if p.name == "README.md"} == folders


@pytest.mark.parametrize("path", MANUALS, ids=name)
def test_every_link_leads_somewhere(path):
    assert not list(broken(path))


def test_a_link_that_leads_nowhere_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Here it is\n[a](#here-it-is) [b](#there) [c](no.md) [d](page.md#here-it-is)")
    assert list(broken(page)) == ["#there", "no.md"]


@pytest.mark.parametrize("block", blocks("python"))
def test_every_python_example_runs(block, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "<manual>", "exec"), {"__name__": "manual"})


@pytest.mark.parametrize("block", blocks("toml"))
def test_every_toml_example_is_what_it_is_said_to_be(block):
    table = tomllib.loads(block)
    if "run" in table:  # README's parts are run by test_own_parts.py
        assert parse(table, "mine", "mine.toml").frames == 240


@pytest.mark.parametrize("path", MANUALS, ids=name)
def test_every_command_shown_has_its_options(path):
    if path.name == "CHANGELOG.md":
        return  # it names what there was
    for first, *words in commands_of(path.read_text()):
        if first.startswith("-"):
            assert first in {o for p in app.get_params(click.Context(app)) for o in p.opts}, first
            continue
        assert first in app.commands, f"{path}: {first}"
        options = {o for p in app.commands[first].params for o in (*p.opts, *p.secondary_opts)}
        for word in words:
            if word.startswith("-"):
                assert word in options, f"{path}: servobench {first} {word}"


def test_commands_are_found_in_blocks_and_in_sentences():
    text = "```\nuv run servobench run a # first\n```\nThen `servobench list b`, `servobench`."
    assert list(commands_of(text)) == [["run", "a"], ["list", "b"]]


def test_the_scenario_manual_names_every_table_and_key():
    text = (ROOT / "scenes" / "README.md").read_text()
    rows = dict(re.findall(r"^\| `\[+(\w+)\]+` \| (.*?) \|", text, re.MULTILINE))
    assert rows.keys() == {*KEYS}
    for table, config in SECTIONS.items():
        named = re.findall(r"`(\w+)`", rows[table])
        assert named == [f.name for f in dataclasses.fields(config)], table
    for table, (_, default) in PLUGINS.items():
        assert re.search(rf"^\| `\[{table}\]`.*default `{default}`", text, re.MULTILINE), table


def test_the_manuals_name_every_scenario_study_measure_and_kind():
    scenes, tracking, servo = (
        (ROOT / folder / "README.md").read_text() for folder in ("scenes", "tracking", "servo")
    )
    folders = {part: folder for part, (folder, _) in PLUGINS.items()} | LISTS
    asked = [(scenes, [*shipped(), *studies(), *MEANINGS])]
    listed = scenes.partition("### Kinds")[2].partition("\n## ")[0]
    asked += [
        (listed, folders[part].names()) for part in ("robot", "target", "motion", "disturbances")
    ]
    asked += [
        (tracking, folders["tracker"].names()),
        (tracking, generators.KINDS.names()),
    ]
    asked += [(servo, folders[part].names()) for part in ("features", "estimator")]
    missing = [word for text, words in asked for word in words if f"`{word}`" not in text]
    assert not missing
    assert {"ibvs", "qp", "hold"} == {*folders["controller"].names()}


def test_every_test_that_keeps_a_promise_exists():
    text = (ROOT / "README.md").read_text().partition("## What you can rely on")[2]
    for file in re.findall(r"`(?:tests/)?(test_[\w*]+\.py)`", text):
        assert list((ROOT / "tests").glob(file)), file


def test_every_file_named_in_the_guide_exists():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    for path in re.findall(r"`((?:servo|tracking|sim|tests)/[\w/.]+)`", text):
        assert path.endswith("NAME_command.py") or (ROOT / path).exists(), path


def test_every_source_that_the_code_cites_is_in_the_references():
    entries = (ROOT / "tracking" / "REFERENCES.md").read_text().split("\n- ")
    code = [p.read_text() for f in ("servo", "sim", "tracking") for p in (ROOT / f).rglob("*.py")]
    cited = {m.groups() for text in code for m in CITED.finditer(" ".join(text.split()))}
    assert ("Perez", "2002") in cited
    missing = {c for c in cited if not any(c[0] in e and c[1] in e for e in entries)}
    assert not missing
