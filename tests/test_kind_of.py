"""A `Config` carries its kind, whatever table a scenario came from."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from elsewhere import MyConfig
from made import Good

from servo.mistake import Mistake
from servo.scenario.catalogue import LISTS, PLUGINS
from servo.scenario.load import load
from servo.study import suites
from servo.study.sequence_run import Contender
from servo.study.suites import GENERATORS
from sim import kinds
from tracking.trackers import KINDS as TRACKERS
from tracking.trackers import kams

FOLDERS = [*(folder for folder, _ in PLUGINS.values()), *LISTS.values(), GENERATORS]


@dataclass(frozen=True)
class Named(MyConfig):
    kind: ClassVar[str] = "mine"


@dataclass(frozen=True)
class Confusing(MyConfig):
    kind: str = "a setting of theirs"


def bare(config):
    """An instance without its settings, of which some are required."""
    return object.__new__(config)


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_kind_of_ours_is_named_by_its_file(folder):
    names = folder.names()
    assert [kinds.kind_of(bare(folder.config_of(name))) for name in names] == names


def test_one_from_elsewhere_is_named_by_module_and_class_or_by_itself():
    assert kinds.kind_of(MyConfig()) == "elsewhere:MyConfig"
    assert kinds.kind_of(Named()) == "mine"
    assert kinds.kind_of(Confusing()).endswith("test_kind_of:Confusing")


def test_a_callable_object_with_methods_of_ours_is_no_function_that_makes_a_tracker():
    class Callable(Good):
        def __call__(self):
            raise AssertionError

    mine = Callable(None)
    config = TRACKERS.as_config(mine, "mine")
    assert config().build(np.random.default_rng(0)) is mine


def test_settings_name_what_replaced_a_part():
    scenario = load("still", ["tracker.kind=pf_ssd"])
    mine = replace(scenario, tracker=MyConfig(gain=2.0)).settings()
    assert mine["tracker"] == {"kind": "elsewhere:MyConfig", "gain": 2.0}
    assert replace(scenario, tracker=kams.Config()).settings()["tracker"]["kind"] == "kams"
    shown = load("occlusion")
    assert [d["kind"] for d in shown.settings()["disturbances"]] == ["board"]
    assert replace(shown, disturbances=()).settings()["disturbances"] == []


def test_contenders_of_the_command_line_may_be_programs_with_labels():
    text = "mine=program:python x.py --size=2, kams:paper, elsewhere:MyConfig"
    mine, paper, own = suites.contenders(text)
    assert [one.label for one in (mine, paper)] == ["mine", "kams-paper"]
    assert (mine.config.command, own.config) == ("python x.py --size=2", MyConfig())
    assert suites.tracker_tables("a=kams") == {"a": {"tracker.kind": "kams"}}
    with pytest.raises(Mistake, match=r"^'program:': write the command after it$"):
        suites.contenders("program:")


def test_contenders_say_so_too():
    assert Contender("a", MyConfig()).describe() == {
        "kind": "elsewhere:MyConfig",
        "settings": {"gain": 1.0},
    }
    assert Contender("a", kams.Config()).describe()["kind"] == "kams"
