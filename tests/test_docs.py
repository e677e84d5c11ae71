"""The documentation site: it builds without a warning, and its links lead somewhere."""

import re
import subprocess
import sys
import webbrowser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from click.testing import CliRunner

from servo.cli import docs_command
from servo.cli.main import app
from servo.mistake import Mistake
from servo.scenario.catalogue import PLUGINS, shipped

LINK = re.compile(r'(?:href|src)="([^"]+)"')
ANCHOR = re.compile(r'\bid="([^"]+)"')


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site; a process of its own, because Sphinx changes the one that it runs in."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "servo", "docs", "--no-open", "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [str(folder.resolve() / "index.html")]
    return folder


@pytest.mark.processes
def test_every_link_and_picture_of_the_site_is_there(site):
    texts = {page: page.read_text() for page in site.rglob("*.html") if "_static" not in page.parts}
    anchors = {page: set(ANCHOR.findall(text)) for page, text in texts.items()}
    wrong = []
    for page, text in texts.items():
        for link in map(urlsplit, LINK.findall(text)):
            if link.scheme:
                continue
            target = (page.parent / unquote(link.path)).resolve() if link.path else page
            there = target.is_file() and (not link.fragment or target not in anchors)
            if not there and unquote(link.fragment) not in anchors.get(target, ()):
                wrong.append((page.name, link.geturl()))
    assert len(texts) > 30
    assert wrong == []


@pytest.mark.processes
def test_the_site_shows_every_setting_and_scenario(site):
    settings = (site / "servo" / "docs" / "settings.html").read_text()
    kinds = [f"&quot;{kind}&quot;" for folder, _ in PLUGINS.values() for kind in folder.names()]
    assert [kind for kind in kinds if kind not in settings] == []
    assert "tracker.particles" in settings
    gallery = site / "gallery"
    assert sorted(picture.stem for picture in gallery.glob("*.webp")) == shipped()


def test_the_missing_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "sphinx.cmd.build", None)
    with pytest.raises(
        Mistake, match=r"^docs needs the extra 'docs': pip install 'servobench\[docs\]'$"
    ):
        docs_command.build(tmp_path)


def test_an_installed_package_has_no_manuals(monkeypatch, tmp_path):
    monkeypatch.setattr(docs_command, "ROOT", tmp_path)
    with pytest.raises(Mistake, match=r"^docs needs a checkout of servobench"):
        docs_command.build(tmp_path)


@pytest.mark.parametrize(
    ("options", "opened"), [([], ["file:///a/index.html"]), (["--no-open"], [])]
)
def test_the_page_is_opened_unless_that_is_not_wanted(monkeypatch, options, opened):
    shown, given = [], []
    monkeypatch.setattr(
        docs_command, "build", lambda out: given.append(out) or Path("/a/index.html")
    )
    monkeypatch.setattr(webbrowser, "open", shown.append)
    assert CliRunner().invoke(app, ["docs", *options]).output == "/a/index.html\n"
    assert shown == opened
    assert given == [Path("runs/docs")]
