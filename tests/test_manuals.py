"""The manuals: links lead somewhere, examples run, and tables name what there is."""

import dataclasses
import json
import re
import tomllib
from pathlib import Path
from types import SimpleNamespace

import click
import pytest

from servo.cli.main import app
from servo.loop.measure import MEASURES as OF_RUNS
from servo.output.steps_table import quantities
from servo.papers.claims import marked
from servo.scenario.catalogue import LISTS, PLUGINS, shipped, studies
from servo.scenario.load import KEYS, SECTIONS, parse
from tracking.evaluation.track_measures import MEASURES
from tracking.sequences import painted as generators

ROOT = Path(__file__).parents[1]
FOLDERS = ("scenes", "servo", "sim", "tests", "tracking")
MANUALS = sorted([*ROOT.glob("*.md"), *(p for f in FOLDERS for p in (ROOT / f).rglob("*.md"))])
TUTORIALS = ROOT / "servo" / "tutorials"
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

NAME = r"[A-Z][a-z]+(?:-[A-Z][a-z]+)?"
CITED = re.compile(
    rf"({NAME})(?:(?:,| and) {NAME}(?: [A-Z][a-z]+)?)*(?: et al\.)?,? ((?:19|20)\d\d)\b"
)
"""Such as "Isard and Blake 1998" or "Perez et al. 2002"."""


def name(path):
    return str(path.relative_to(ROOT))


def blocks(language):
    """The examples of the manuals; those of tutorials are run by `test_tutorials.py`."""
    pages = [m for m in MANUALS if m.parent != TUTORIALS]
    found = [(m, b) for m in pages for of, b in BLOCK.findall(m.read_text()) if of == language]
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
            yield re.findall(r"'[^']*'|\S+", found[1].partition(" # ")[0])


def test_there_is_a_manual_for_each_subject():
    folders = {".", "scenes", "tracking", "servo", "servo/papers", "servo/tutorials"}
    folders |= {"scenes/benchmarks", "tests/benchmarks"}
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
    if "servo.ros2" in block:
        pytest.importorskip("cyclonedds", reason="there is no CycloneDDS for this Python")
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


def section(page, heading):
    """The text of a page below a heading, up to the next one; BLOCKs are left out."""
    text = BLOCK.sub("", (ROOT / page).read_text())
    assert f"\n{heading}\n" in text, f"{page}: {heading}"
    return re.split(r"^#+ ", text.partition(f"\n{heading}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]


def rows(text):
    """The cells of a table's rows, without its head."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    heads = {k for k, row in enumerate(cells) if set("".join(row)) <= set("-")}
    return [row for k, row in enumerate(cells) if k not in heads and k + 1 not in heads]


def named(text, column=0):
    """The names in backquotes in a column of the tables of a text."""
    return [word for row in rows(text) for word in re.findall(r"`([^`]+)`", row[column])]


KINDS = {part: kinds for part, (kinds, _) in PLUGINS.items()} | LISTS
TABLES = {
    ("scenes/README.md", "## Measures"): lambda: list(OF_RUNS),
    ("scenes/README.md", "### Targets"): KINDS["target"].names,
    ("scenes/README.md", "## Studies"): studies,
    ("servo/README.md", "## Features"): KINDS["features"].names,
    ("servo/README.md", "## Estimators"): KINDS["estimator"].names,
    ("servo/README.md", "### Columns of steps.parquet"): lambda: [
        quantity.name for quantity in quantities(SimpleNamespace(names=(), units=()), (), ())
    ],
    ("tracking/README.md", "## Trackers"): KINDS["tracker"].names,
    ("tracking/README.md", "### Measures of a track"): lambda: [m.name for m in MEASURES],
}
"""What the first column of a table names, by page and heading: all of it, and nothing else."""


@pytest.mark.parametrize(("page", "heading"), TABLES)
def test_a_table_names_all_there_is(page, heading):
    found = named(section(page, heading))
    assert sorted(found) == sorted(TABLES[page, heading]())


def test_tables_of_measures_have_the_units_of_the_code():
    shown = {row[0].strip("`"): row[1] for row in rows(section("scenes/README.md", "## Measures"))}
    assert shown == {name: measure.unit for name, measure in OF_RUNS.items()}
    table = rows(section("tracking/README.md", "### Measures of a track"))
    shown = {row[0].strip("`"): tuple(row[1:3]) for row in table}
    assert shown == {m.name: (m.unit, m.better.value) for m in MEASURES}


def test_the_manuals_name_every_scenario_and_kind():
    assert sorted(named(section("scenes/README.md", "## Shipped scenarios"), 1)) == sorted(
        shipped()
    )
    listed = section("scenes/README.md", "## Kinds")
    suites = named(section("tracking/README.md", "## Compare trackers"))
    law = named(section("servo/README.md", "## The control law"))
    missing = [
        kind
        for part in ("robot", "target", "motion", "disturbances")
        for kind in KINDS[part].names()
        if f"`{kind}`" not in listed
    ]
    missing += [kind for kind in generators.KINDS.names() if kind not in suites]
    missing += [kind for kind in KINDS["controller"].names() if kind not in law]
    assert not missing


def contents(folder):
    """The rooms of a package and its modules, such as "loop/" and "gym.py"."""
    files = [p for p in (ROOT / folder).glob("*/*") if p.suffix in {".py", ".md"}]
    return {f"{p.parent.name}/" for p in files} | {p.name for p in (ROOT / folder).glob("[!_]*.py")}


@pytest.mark.parametrize("folder", ["servo", "tracking"])
def test_a_table_names_every_room(folder):
    text = (ROOT / folder / "README.md").read_text().partition("\n## ")[0]
    shown = {word for word in named(text) if word.count("/") < 2}
    assert shown == contents(folder)


def test_the_page_of_benchmarks_names_every_script():
    folder = ROOT / "tests" / "benchmarks"
    shown = set(re.findall(r"`(\w+\.py)`", (folder / "README.md").read_text()))
    assert shown == {path.name for path in folder.glob("*.py")}


def test_the_guide_names_every_room_of_the_world():
    shown = named(section("CONTRIBUTING.md", "## Where to find it"))
    rooms = {f"sim/{name}" for name in contents("sim") if name.endswith("/")}
    assert {word for word in shown if word.startswith("sim/")} == rooms | {"sim/"}


def test_every_command_answers_a_question():
    shown = {words[0] for words in commands_of((ROOT / "servo" / "COMMANDS.md").read_text())}
    assert shown == {name for name, command in app.commands.items() if not command.hidden}


def test_the_verdicts_shown_are_those_kept():
    kept = json.loads((ROOT / "servo" / "papers" / "verdicts.json").read_text())
    text = (ROOT / "servo" / "papers" / "RESULTS.md").read_text()
    registered, others = text.split("## The same on other seeds")
    shown = {
        re.sub(r"\[(.*?)\].*", r"\1", row[0]): (row[3], row[5].replace("*", ""))
        for row in rows(registered)
    }
    assert shown == {
        name: (effect, marked(name, finding)) for name, (finding, effect) in kept.items()
    }
    for name, effect, _, finding in rows(others):
        assert finding.split(", not ")[-1] == kept[name][0]
        assert re.sub(r"(?<=\d) .*(?= \()", "", kept[name][1]) == effect


def settings(schema, definitions):
    """The names of all settings in a JSON Schema, however deep."""
    if isinstance(schema, dict):
        schema = definitions.get(schema.get("$ref", "").rpartition("/")[2], schema)
        properties = schema.get("properties", {})
        inner = [*properties.values(), *(v for k, v in schema.items() if k != "properties")]
        return set(properties).union(*(settings(part, definitions) for part in inner))
    inner = schema if isinstance(schema, list) else []
    return set().union(*(settings(part, definitions) for part in inner))


@pytest.mark.parametrize("path", MANUALS, ids=name)
def test_every_setting_named_exists(path):
    schema = json.loads((ROOT / "scenes" / "scenario.schema.json").read_text())
    tables = schema["properties"]
    there = {table: settings(tables[table], schema["$defs"]) for table in (*SECTIONS, *PLUGINS)}
    there["tracker"].add("command")  # of `trax`: from the command line only, so not in the schema
    prose = BLOCK.sub("", path.read_text())
    for code in re.findall(r"`([^`\n]+)`", prose):
        for table, keys in re.findall(
            rf"(?<![\w./])({'|'.join(there)})\.([a-z]\w*(?:\.[a-z]\w*)*)", code
        ):
            if keys not in {"csv", "md", "mp4", "png", "py", "rrd", "toml"}:  # a file
                assert not {*keys.split(".")} - there[table], f"{path}: {code}"


def test_every_test_that_keeps_a_promise_exists():
    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## What you can rely on")[2]
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
