"""Targets of every kind: seen where and how their settings say, or refused with what is wrong."""

import cv2
import mujoco
import numpy as np
import pytest
from seen_targets import PLACED, RNG, SHEET, build, rectangle_of

from servo.cli.run_command import remarks
from servo.loop.episode import Episode
from servo.scenario.load import load
from servo.study.run import Job
from servo.study.run_report import RunReport
from servo.study.scenario_run import LoadedScenario, record_of
from sim.disturbances import second_target
from sim.targets import KINDS as TARGETS
from sim.targets import box, mesh, mjcf, plate, tag

KINDS = TARGETS.names()
CONFIGS = [TARGETS.config_of(kind)() for kind in KINDS]
CLOSED = [c for k, c in zip(KINDS, CONFIGS, strict=True) if k in ("box", "mesh", "mjcf")]


def corner_colours():
    """A picture of four colours: red, green above blue, yellow; an odd number of pixels wide."""
    picture = np.zeros((60, 81, 3), np.uint8)
    picture[:30, :40], picture[:30, 40:] = (0, 0, 255), (0, 255, 0)
    picture[30:, :40], picture[30:, 40:] = (255, 0, 0), (0, 255, 255)
    return picture


RED, GREEN, BLUE, YELLOW = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0)


def quarters(image, truth):
    """The strongest colours (as of a pure one) in the four quarters of the rectangle, from the top
    left clockwise as an image with the nose to the right shows them.
    """
    centres = (truth.corners + truth.centre) / 2
    pixels = [image[int(v), int(u)].astype(int) for u, v in centres]
    return [tuple(int(255 * (c > 0.5 * max(p))) for c in p) for p in pixels]


@pytest.mark.parametrize("theta", [0.0, 0.7, 3.0])
@pytest.mark.parametrize("kind", ["plate", "box", "mesh"])
def test_a_picture_has_its_right_at_the_nose_and_is_not_mirrored(
    show_target, model_folder, kind, theta
):
    cv2.imwrite("four.png", corner_colours())
    sheet = SHEET.replace("-2", "-.5").replace("2 0", ".5 0") + PLACED + "f 1/1 2/2 3/3 4/4\n"
    (model_folder / "sheet.obj").write_text(sheet)
    config = {
        "plate": plate.Config(picture="four.png"),
        "box": box.Config(picture="four.png"),
        "mesh": mesh.Config(file="sheet.obj", texture="four.png"),
    }[kind]
    image, truth, _ = show_target(config, theta)
    assert quarters(image, truth) == [RED, GREEN, YELLOW, BLUE]


@pytest.mark.parametrize("number", [0, 7, 586])
def test_a_tag_is_read_in_the_picture_where_the_truth_says(show_target, number):
    image, truth, _ = show_target(tag.Config(id=number), 0.4)
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    found, ids, _ = cv2.aruco.ArucoDetector(family, options).detectMarkers(image)
    assert ids.ravel().tolist() == [number]
    assert np.abs(found[0][0] - truth.corners).max() < 0.3


def test_a_box_has_its_colour_and_its_rectangle_is_its_top(show_target):
    image, truth, world = show_target(box.Config(colour=(0.0, 1.0, 0.0)))
    np.testing.assert_allclose(np.ptp(world.outline, axis=0), [0.16, 0.1, 0.0], atol=1e-12)
    assert world.outline[0, 2] == 0.04
    green = (image[..., 1] > 100) & (image[..., 0] < 40) & (image[..., 2] < 40)
    v, u = np.nonzero(green)
    np.testing.assert_allclose([u.mean() + 0.5, v.mean() + 0.5], truth.centre, atol=0.6)
    assert green.sum() == pytest.approx(0.16 * 0.1 * truth.size**2, rel=0.05)
    assert box.Config(colour="#00ff00").build(RNG).spec.geoms[0].rgba.tolist() == [0, 1, 0, 1]


CAN = """<mujoco><compiler angle="radian"/>
<asset><texture type="skybox" builtin="flat" rgb1="1 0 0" width="8" height="48"/></asset>
<worldbody>
  <light pos="0 0 3"/><camera name="own"/>
  <body mocap="true" pos=".05 0 0">
    <geom name="can" type="box" size=".02 .06 .05" euler="0 0 1.5707963" pos="0 0 .05"
          rgba="0 1 0 1"/>
    <body><joint name="lid" type="slide"/><geom type="sphere" size=".01" pos="0 0 -.5"/></body>
    <geom type="box" size=".5 .5 .5" group="3"/>
    {}
  </body>
</worldbody>
<actuator><motor name="m" joint="lid"/></actuator>
<keyframe><key qpos="0"/></keyframe></mujoco>"""


def test_a_model_loses_all_but_its_geoms_and_its_rectangle_is_found(show_target, model_folder):
    (model_folder / "can.xml").write_text(CAN.format(""))
    image, truth, world = show_target(mjcf.Config(model="can.xml"))
    np.testing.assert_allclose(rectangle_of(world), [0.12, 0.04, 0.1, 0.05, 0.0], atol=1e-3)
    assert world.outline_found
    assert (world.model.nu, world.model.nkey, world.model.ncam) == (6, 0, 2)
    v, u = np.nonzero((image[..., 1] > 140) & (image[..., 0] < 40))
    np.testing.assert_allclose([u.mean() + 0.5, v.mean() + 0.5], truth.centre, atol=0.6)
    assert (world.model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX).sum() == 1
    body = world.model.body("target").id
    own = world.model.body_rootid[world.model.geom_bodyid] == body
    assert not world.model.geom_contype[own].any()


def test_a_site_called_outline_is_the_rectangle(model_folder):
    site = '<site name="outline" type="box" size=".03 .02 .001" pos=".01 0 .08"/>'
    (model_folder / "can.xml").write_text(CAN.replace("<light", site + "<light").format(""))
    target = build(mjcf.Config(model="can.xml"))
    np.testing.assert_allclose(rectangle_of(target), [0.06, 0.04, 0.08, 0.01, 0.0], atol=1e-12)
    assert not target.found


@pytest.mark.parametrize("config", CONFIGS, ids=KINDS)
def test_a_target_of_any_kind_is_seen_whole_and_has_a_twin(show_target, config):
    twin = second_target.Config(start=0.0, x=0.0, y=0.25).build(RNG)
    alone, truth, _ = show_target(config)
    both, _, world = show_target(config, disturbances=[twin])
    assert truth.visible == 1.0
    changed = np.abs(alone.astype(int) - both).max(axis=2) > 40
    v, u = np.nonzero(changed)
    assert abs(u.mean() - 160) < 8
    assert v.mean() == pytest.approx(120 - 0.25 * truth.size, abs=8)
    covered = changed[:, :].sum() / (np.prod(np.ptp(world.outline[:, :2], axis=0)) * truth.size**2)
    assert 0.2 < covered < 1.7


@pytest.mark.parametrize("config", [*CLOSED, box.Config(size=(0.1, 0.1, 0.5))])
def test_a_twin_that_waits_is_not_seen(show_target, config):
    late = second_target.Config(start=5.0).build(RNG)
    alone, both = (show_target(config, disturbances=d, x=0.25)[0] for d in ((), [late]))
    np.testing.assert_array_equal(alone, both)


def test_the_centre_of_a_rectangle_that_was_found_is_told_and_reported(tmp_path):
    box = '<geom type="box" size=".07 .03 .02" pos=".12 .05 .02"/>'
    (tmp_path / "off.xml").write_text(f"<mujoco><worldbody>{box}</worldbody></mujoco>")
    changes = ["target.kind=mjcf", f"target.model={tmp_path / 'off.xml'}", "tracker.kind=truth"]
    scenario = load("still", [*changes, "run.duration=0.1", "measure.after=0"])
    with Episode(scenario) as episode:
        line, *_ = remarks(episode)
        steps = [step.light() for step in episode]
    sides = "0.140 x 0.060 m, 0.040 m over the table"
    assert f"{sides}, its centre at x = 0.120, y = 0.050 m of the target's frame" in line
    job = Job(0, LoadedScenario(scenario), 0, command="")
    report = RunReport.of(record_of(job, scenario, steps), scenario, steps[0].scene)
    assert report.outline_centre == pytest.approx([0.12, 0.05, 0.04])


def test_a_target_under_the_board_is_half_seen_whatever_groups_its_geoms_have(
    show_target, model_folder
):
    (model_folder / "flat.xml").write_text(
        '<mujoco><worldbody><geom type="box" size=".1 .1 .001" pos="0 0 .001" group="0"/>'
        '<geom type="box" size=".1 .1 .002" pos="0.2 0 .001" group="1"/></worldbody></mujoco>'
    )
    _, truth, world = show_target(mjcf.Config(model="flat.xml"))
    assert truth.visible == 1.0
    board = world.model.body("board")
    world.data.mocap_pos[world.model.body_mocapid[board.id]] = (-0.09, 0.0, 0.3)
    mujoco.mj_kinematics(world.model, world.data)
    assert 0.4 < world.visible() < 0.75
