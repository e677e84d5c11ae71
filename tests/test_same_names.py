"""Files of the user's that have the name of a shipped one: they go first, and it is said."""

import re
import shutil
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

import servo
from servo.mistake import Mistake
from servo.study import parse
from sim import robots
from sim.files.notices import notice
from sim.files.shipped import SameName, file_of
from sim.robots import mjcf

SCENES = Path(str(resources.files("scenes")))
NAMES = [
    ("arm7", "robots", ".xml"),
    ("duck", "targets", ".obj"),
    ("pebbles", "targets", ".png"),
    ("truck", "targets", ".xml"),
    ("brick", "grounds", ".png"),
]


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notice.cache_clear()


def own_arm() -> None:
    """Write the user's own arm7.xml: one joint of the shipped one has another name."""
    text = (SCENES / "robots" / "arm7.xml").read_text("utf-8")
    joint = re.findall(r'<joint name="(\w+)"', text)[0]
    Path("arm7.xml").write_text(text.replace(joint, "mine"), "utf-8")


def joints_of(model: str) -> list[str]:
    """Return the joints of a scenario's robot."""
    scenario = servo.load("still", ["robot.kind=mjcf", f"robot.model={model}"])
    return [j.name for j in scenario.robot.build(np.random.default_rng(0)).spec.joints]


@pytest.mark.parametrize(("name", "folder", "suffix"), NAMES)
def test_a_full_name_is_the_users_file_where_there_is_one(name, folder, suffix):
    shipped = SCENES / folder / f"{name}{suffix}"
    assert file_of(f"{name}{suffix}", folder, suffix, "x") == shipped
    Path(f"{name}{suffix}").touch()
    with pytest.warns(SameName, match=f"{name}{suffix} is your file of this name, not the"):
        assert file_of(f"{name}{suffix}", folder, suffix, "x") == Path(f"{name}{suffix}")


@pytest.mark.parametrize(("name", "folder", "suffix"), NAMES)
def test_a_bare_name_is_the_shipped_file_and_the_users_is_named(name, folder, suffix):
    Path(f"{name}{suffix}").touch()
    with pytest.warns(SameName, match=f"not your {name}{suffix}: write {name}{suffix} for that"):
        assert file_of(name, folder, suffix, "x") == SCENES / folder / f"{name}{suffix}"


@pytest.mark.parametrize(("name", "folder", "suffix"), NAMES)
def test_a_path_with_a_slash_is_never_looked_up_elsewhere(name, folder, suffix):
    assert file_of(f"./{name}{suffix}", folder, suffix, "x") == Path(f"{name}{suffix}")
    assert not file_of(f"./{name}{suffix}", folder, suffix, "x").exists()


def test_the_users_robot_runs_and_not_the_shipped_one():
    own_arm()
    with pytest.warns(SameName):
        assert "mine" in joints_of("arm7.xml")
    assert "mine" in joints_of("./arm7.xml")


def test_our_own_kinds_never_take_a_file_of_the_users():
    for name in ("arm", "gantry", "free"):
        Path(f"{name}.xml").write_text("<mujoco/>", "utf-8")
        assert robots.KINDS.config(name).build(np.random.default_rng(0)).spec.joints


def test_a_file_beside_a_scenario_goes_first(tmp_path):
    (tmp_path / "folder").mkdir()
    own_arm()
    shutil.move("arm7.xml", "folder/arm7.xml")
    text = '[robot]\nkind = "mjcf"\nmodel = "arm7.xml"\n'
    Path("folder/mine.toml").write_text(text, "utf-8")
    with pytest.warns(SameName, match="arm7.xml is your file of this name, not the shipped one"):
        scenario = servo.load("folder/mine.toml")
    assert scenario.robot.model == str(tmp_path / "folder" / "arm7.xml")


def test_a_scenario_and_a_study_of_a_shipped_name_are_said():
    Path("line.toml").write_text("[run]\nduration = 1.0\n", "utf-8")
    with pytest.warns(SameName, match=r"scenario = 'line' is the shipped one, not your line.toml"):
        assert servo.load("line").run.duration > 1.0
    assert servo.load("line.toml").run.duration == 1.0
    Path("line.toml").rename("noise.toml")
    with pytest.warns(SameName, match=r"study = 'noise' is the shipped one, not your noise.toml"):
        parse.load("noise")


def test_a_bare_name_that_is_nothing_lists_the_shipped_ones():
    with pytest.raises(
        ValueError, match="'arm8': no file of this name is shipped; give arm, arm7, free"
    ):
        mjcf.model_path("arm8")
    with pytest.raises(Mistake, match="no scenario 'lines'"):
        servo.load("lines")
