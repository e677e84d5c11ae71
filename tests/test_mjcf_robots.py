"""Robots of others: they follow the target as they are, or are refused with what is wrong."""

import re
import shutil
import sys
from pathlib import Path

import mujoco
import mujoco_menagerie
import numpy as np
import pytest
from measured import measured_run
from mujoco_menagerie._cache import SENTINEL, Cache
from robot_files import built, mjcf_arm, tall_arm, urdf_arm, write_stl

from servo.loop.episode import Episode
from servo.scenario.load import load
from sim.camera.camera import CameraConfig, camera_of
from sim.geometry import mount_pose
from sim.kinematics import drives
from sim.kinematics.inverse_kinematics import comfort, reach
from sim.kinematics.model import FARTHEST
from sim.kinematics.robot import STOP_MARGIN, Inversion
from sim.mounting import CAMERA
from sim.robots import mjcf
from sim.types import Pose

BASE = (0.0, 0.5, 0.6, -90.0)


@pytest.fixture
def urdf(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_arm())
    return tmp_path / "arm.urdf"


@pytest.fixture
def seven(tmp_path):
    (tmp_path / "arm.xml").write_text(mjcf_arm(tmp_path))
    return tmp_path / "arm.xml"


@pytest.mark.wide
@pytest.mark.parametrize("name", ["urdf", "seven"])
def test_an_arm_that_nobody_tuned_follows_the_line(request, name):
    model = request.getfixturevalue(name)
    changes = [
        "robot.kind=mjcf",
        f"robot.model={model}",
        "motion.x=-0.35",
        "run.duration=4.0",
        "measure.after=2.0",
        "estimator.kind=kalman_cv",
    ]
    scenario = load("line", changes)
    steps, report = measured_run(scenario)
    assert report.outcome.name == "CONVERGED"
    assert report.measures["servo_rms_px"] <= 1.0
    assert report.measures["saturated_pct"] == 0.0
    assert len(steps[0].posture.joints) == (6 if name == "urdf" else 7)


def test_a_urdf_gives_joints_limits_and_speeds(urdf):
    robot, model, _ = built(model=str(urdf))
    assert robot.names == ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    np.testing.assert_allclose(robot.fastest, 3.15)
    np.testing.assert_allclose(robot.upper, 6.28)
    assert model.actuator_forcerange[:3, 1].tolist() == [150.0] * 3
    assert set(model.body_gravcomp[model.body_rootid == model.body("robot/base").id]) == {1.0}


def test_a_force_limit_that_cannot_move_the_joint_is_left_out(tmp_path):
    (tmp_path / "weak.urdf").write_text(urdf_arm(effort=0.0))
    _, model, _ = built(model=str(tmp_path / "weak.urdf"))
    assert not model.actuator_forcelimited.any()
    assert not model.jnt_actfrclimited.any()


def test_what_a_room_has_and_what_a_gripper_needs_is_left_out(seven):
    robot, model, _ = built(model=str(seven))
    assert robot.names == tuple(f"joint{i}" for i in range(1, 8))
    assert (model.nu, model.ntendon, model.neq, model.nkey) == (7, 0, 0, 0)
    names = [model.geom(i).name for i in range(model.ngeom)]
    assert "robot/floor" not in names
    own = np.array(
        [n.startswith("robot/") for n in (model.body(b).name for b in model.geom_bodyid)]
    )
    assert own.sum() == 9  # seven links and two fingers, which are held still
    assert not model.geom_contype[own].any()
    assert not model.geom_conaffinity[own].any()
    assert model.nlight == 2  # the room's
    assert (model.tex_type == int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)).sum() == 1
    assert model.nmesh == 2


def test_drives_take_a_new_rate_within_the_time_constant(seven):
    robot, model, data = built(model=str(seven))
    data.qpos[:] = [0, 0.3, 0, -1.5, 0, 1.8, 0]
    data.ctrl[:] = 0.1
    mujoco.mj_step(model, data, round(0.06 * 480))
    np.testing.assert_allclose(robot.rates_measured(data), 0.1, rtol=0.1)
    mujoco.mj_step(model, data, round(0.3 * 480))
    np.testing.assert_allclose(robot.rates_measured(data), 0.1, rtol=0.03)


def test_gravity_does_not_move_a_robot_that_is_told_to_stay(seven):
    robot, model, data = built(model=str(seven))
    data.qpos[:] = q = np.array([0, 0.9, 0, -1.5, 0, 1.8, 0])
    mujoco.mj_step(model, data, 480)
    np.testing.assert_allclose(robot.joints(data), q, atol=1e-6)


def camera_in_flange(seven, mount):
    robot, model, data = built(model=str(seven), base=BASE, flange="attachment", mount=mount)
    data.qpos[:] = [0.1, 0.3, 0.2, -1.5, 0.3, 1.8, 0.4]
    mujoco.mj_kinematics(model, data)
    site = model.site("robot/attachment").id
    flange = Pose(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])
    return flange.inverse() @ robot.eye(data), robot.eye(data)


def test_the_camera_is_at_the_mount_in_the_flange(seven):
    found, _ = camera_in_flange(seven, (0.0,) * 6)
    np.testing.assert_allclose(found.rotation, np.eye(3), atol=1e-12)
    found, _ = camera_in_flange(seven, (0.01, 0.02, 0.03, 90.0, 0.0, 90.0))
    # First about the fixed x: y becomes z; then about the fixed z: x becomes y.
    np.testing.assert_allclose(found.rotation, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(found.translation, [0.01, 0.02, 0.03], atol=1e-12)


@pytest.mark.parametrize(("camera", "fovy"), [("hand", 58.0), ("", 45.0)])
def test_a_camera_of_the_model_keeps_its_field_of_view(tmp_path, camera, fovy):
    hand = '<site name="tool"/><camera name="hand" resolution="640 480"/>'
    own = tall_arm().replace('<site name="tool"/>', hand)
    own = own.replace("<worldbody>", '<default><camera fovy="58"/></default><worldbody>')
    (tmp_path / "arm.xml").write_text(own)
    _, model, _ = built(model=str(tmp_path / "arm.xml"), camera=camera)
    config = CameraConfig()
    focal = config.height / 2 / np.tan(np.radians(fovy) / 2)
    assert camera_of(config, model, CAMERA).fy == pytest.approx(focal)
    lens = CameraConfig(distortion="fisheye", coefficients=(0.0,) * 4)
    focal = config.height / np.radians(fovy)
    assert camera_of(lens, model, CAMERA).fy == pytest.approx(focal)


def test_the_base_moves_and_turns_the_whole_robot(seven):
    poses = []
    for base in ((0.0, 0.0, 0.0, 0.0), (0.3, -0.2, 0.5, 90.0)):
        robot, model, data = built(model=str(seven), base=base)
        mujoco.mj_kinematics(model, data)
        poses.append(robot.eye(data))
    moved = Pose(mount_pose((0, 0, 0, 0, 0, 90.0)).rotation, np.array([0.3, -0.2, 0.5])) @ poses[0]
    np.testing.assert_allclose(poses[1].rotation, moved.rotation, atol=1e-12)
    np.testing.assert_allclose(poses[1].translation, moved.translation, atol=1e-12)


def test_a_redundant_arm_moves_away_from_its_limits_without_moving_the_camera(seven):
    robot, model, data = built(model=str(seven))
    data.qpos[:] = [0.3, 0.6, 0.8, -2.2, 0.5, 2.0, 2.0]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    rates, _, limited = robot.rates(data, np.zeros(6))
    assert not limited
    np.testing.assert_allclose(robot.jacobian(data) @ rates, 0, atol=1e-12)
    middles = (robot.lower + robot.upper) / 2
    assert rates @ (middles - robot.joints(data)) > 0.01
    twist = np.array([0.05, 0.02, 0.01, 0.1, 0.0, 0.1])
    np.testing.assert_allclose(robot.jacobian(data) @ robot.rates(data, twist)[0], twist, atol=1e-9)


def test_centring_gives_way_where_it_would_slow_the_camera(seven):
    robot, model, data = built(Inversion(centring=100.0), model=str(seven))
    data.qpos[:] = [0.3, 0.6, 0.8, -2.2, 0.5, 2.0, 2.0]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    twist = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.1])
    rates, _, limited = robot.rates(data, twist)
    assert not limited
    assert np.all((rates >= robot.slowest) & (rates <= robot.fastest))
    np.testing.assert_allclose(robot.jacobian(data) @ rates, twist, atol=1e-4)


def test_the_other_joints_go_on_where_one_is_at_its_limit(seven):
    """A twist that would push a joint against its stop is made by the six others."""
    robot, model, data = built(model=str(seven))
    data.qpos[:] = [0.3, 0.6, 0.8, -1.6, 0.5, 2.0, 2.0]
    data.qpos[0] = robot.upper[0] - STOP_MARGIN
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    J = robot.jacobian(data)
    twist = 0.05 * J[:, 0] + 0.02 * J[:, 3]
    assert (np.linalg.pinv(J) @ twist)[0] > 0.01  # the least rates need it
    rates, _, limited = robot.rates(data, twist)
    assert not limited
    assert rates[0] <= 1e-9
    np.testing.assert_allclose(J @ rates, twist, atol=1e-4)


def test_a_start_pose_is_inside_the_limits_and_exact(seven):
    robot, _, data = built(model=str(seven), base=BASE)
    wanted = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.05, 1.0]))
    assert reach(robot, data, wanted)
    q = robot.joints(data)
    assert np.all((q > robot.lower) & (q < robot.upper))
    np.testing.assert_allclose(robot.eye(data).translation, wanted.translation, atol=1e-9)
    np.testing.assert_allclose(robot.eye(data).rotation, wanted.rotation, atol=1e-9)


@pytest.mark.parametrize("height", [0.75, 0.8, 0.85, 0.95, 1.0])
def test_a_start_pose_is_found_behind_the_limits(tmp_path, height):
    """Quadratic programmes alone end at limits, at 0.80 and 0.85 m from all 40 postures."""
    (tmp_path / "tall.xml").write_text(tall_arm())
    robot, _, data = built(model=str(tmp_path / "tall.xml"), base=(0.0, 0.54, 0.68, -90.0))
    wanted = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, height]))
    assert reach(robot, data, wanted)
    q = robot.joints(data)
    assert np.all((q > robot.lower) & (q < robot.upper))
    np.testing.assert_allclose(robot.eye(data).translation, wanted.translation, atol=1e-9)
    np.testing.assert_allclose(robot.eye(data).rotation, wanted.rotation, atol=1e-9)


def test_a_home_decides_between_solutions(urdf):
    wanted = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.05, 1.0]))
    robot, _, data = built(model=str(urdf), base=BASE)
    assert reach(robot, data, wanted)
    q = robot.joints(data) + 0.1
    other = np.where(np.arange(6) == 5, q - 2 * np.pi * np.sign(q), q)
    for home in (q, other):
        robot, _, data = built(model=str(urdf), base=BASE, home=(tuple(home),))
        assert reach(robot, data, wanted)
        assert np.abs(robot.joints(data) - home).max() < 0.5


def test_a_model_is_found_beside_its_scenario_and_in_the_menagerie(tmp_path, urdf, monkeypatch):
    (tmp_path / "mine.toml").write_text('[robot]\nkind = "mjcf"\nmodel = "arm.urdf"\n')
    assert load(str(tmp_path / "mine.toml")).robot.model == str(urdf)
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(ValueError, match="pip install mujoco-menagerie, or set MENAGERIE_ROOT to"):
        mjcf.model_path("menagerie:arm.urdf")
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    assert mjcf.model_path("menagerie:arm.urdf") == urdf
    assert mjcf.model_path("arm7.xml").name == "arm7.xml"
    assert mjcf.model_path("arm7.xml").is_absolute()


def test_a_robot_of_the_package_mujoco_menagerie_runs(tmp_path, urdf, monkeypatch):
    """The package's own code; its cache holds an arm of ours under the name of a robot."""
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", str(tmp_path / "cache"))
    arm = mujoco_menagerie.get("universal_robots_ur5e")
    folder = Cache().model_path(arm)
    folder.mkdir(parents=True)
    (folder / SENTINEL).touch()
    (folder / "ur5e.xml").write_text(mjcf_arm(folder))
    for name in ("menagerie:universal_robots_ur5e", "menagerie:universal_robots_ur5e/ur5e.xml"):
        assert mjcf.model_path(name) == folder / "ur5e.xml"
    robot = ["robot.kind=mjcf", f"robot.model={name}", "robot.flange=link7", "run.duration=0.1"]
    with Episode(load("still", [*robot, "tracker.kind=truth"])) as episode:
        assert len(list(episode)) == 3
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    shutil.copytree(folder, tmp_path / "universal_robots_ur5e")
    assert mjcf.model_path(name.removesuffix("/ur5e.xml")).parent.parent == tmp_path


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("universal_robots_ur5", "Unknown robot 'universal_robots_ur5'. Did you mean 'universal_"),
        ("universal_robots_ur5e/arm.xml", "'universal_robots_ur5e' has no entry point 'arm'; avai"),
        ("", "Unknown robot ''."),
    ],
)
def test_what_the_package_does_not_have_is_a_sentence(tmp_path, monkeypatch, name, sentence):
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(Cache, "resolve", lambda cache, robot, progress: tmp_path)
    with pytest.raises(ValueError, match=re.escape(f"menagerie:{name}: {sentence}")):
        mjcf.model_path(f"menagerie:{name}")


def test_a_robot_that_cannot_be_downloaded_is_a_sentence(tmp_path, monkeypatch):
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("MENAGERIE_BASE_URL", tmp_path.as_uri())
    with pytest.raises(
        ValueError,
        match=r": this robot cannot be downloaded: .*not found; without a network, set MENAGERIE_ROOT to the",
    ):
        mjcf.model_path("menagerie:universal_robots_ur5e")


def test_a_urdf_with_unknown_inertias_is_driven_all_the_same(tmp_path):
    text = re.sub(r'ixx="0.02" iyy="0.02" izz="0.01"', 'ixx="0" iyy="0" izz="0"', urdf_arm())
    (tmp_path / "zero.urdf").write_text(text)
    robot, model, data = built(model=str(tmp_path / "zero.urdf"))
    data.ctrl[:] = 0.1
    mujoco.mj_step(model, data, 240)
    np.testing.assert_allclose(robot.rates_measured(data), 0.1, rtol=0.05)


@pytest.mark.wide
def test_a_home_that_looks_straight_up_is_no_obstacle(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_arm())
    robot, _, data = built(model=str(tmp_path / "arm.urdf"), base=BASE)
    data.qpos[:] = 0.3
    mujoco.mj_kinematics(robot.model, data)
    above = robot.eye(data)
    robot, _, data = built(model=str(tmp_path / "arm.urdf"), base=BASE, home=((0.3,) * 6,))
    reached = reach(
        robot, data, Pose(above.rotation @ np.diag([1.0, -1.0, -1.0]), above.translation)
    )
    assert reached.there or 0.0 < reached.angle <= np.pi


@pytest.mark.wide
def test_the_angle_that_is_left_is_right_up_to_half_a_turn(seven):
    robot, _, data = built(model=str(seven), base=BASE)
    far = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 9.0]))
    reached = reach(robot, data, far)
    error = robot.eye(data).inverse() @ far
    assert not reached
    assert reached.distance == pytest.approx(float(np.linalg.norm(error.translation)))
    assert reached.angle == pytest.approx(np.arccos((np.trace(error.rotation) - 1) / 2), abs=1e-6)


@pytest.mark.parametrize("far", ["inf", "1e308", "1e20", "nan"])
def test_limits_that_are_none_in_a_urdf_are_none(tmp_path, far):
    robot, _, _ = built(model=str(endless(tmp_path, f"-{far}", far)))
    assert np.isinf(robot.lower).all()
    assert np.isinf(robot.upper).all()
    assert (robot.fastest == drives.SPEEDS["hinge"]).all()
    assert np.isfinite(
        drives.random_joints(robot.model, robot.ids, np.random.default_rng(0), 3)
    ).all()


def test_of_a_single_limit_in_a_urdf_the_other_side_is_far(tmp_path):
    robot, _, _ = built(model=str(endless(tmp_path, "-2", "inf")))
    assert (robot.lower == -2).all()
    assert (robot.upper == FARTHEST).all()


def endless(folder, lower: str, upper: str) -> Path:
    """Write a URDF of which all joints have these limits."""
    arm = folder / "endless.urdf"
    limit = f'<limit lower="{lower}" upper="{upper}" effort="{upper}" velocity="{upper}"/>'
    arm.write_text(re.sub("<limit[^>]*/>", limit, urdf_arm()))
    return arm


def test_a_mesh_of_a_package_without_a_package_xml_is_found_in_a_folder_above(tmp_path):
    for name in ("arms/meshes", "arms/models/one"):
        (tmp_path / name).mkdir(parents=True)
    write_stl(tmp_path / "arms/meshes/link.stl")
    mesh = '<mesh filename="package://arms/meshes/link.stl"/>'
    urdf = urdf_arm().replace('<cylinder radius="0.03" length="0.06"/>', mesh)
    (tmp_path / "arms/models/one/arm.urdf").write_text(urdf)
    robot, _, _ = built(model=str(tmp_path / "arms/models/one/arm.urdf"))
    assert robot.model.nmesh > 0


def test_a_posture_with_a_link_before_the_camera_or_below_the_table_is_a_hundredth(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf_arm())
    robot, _, data = built(model=str(tmp_path / "arm.urdf"), base=BASE)
    rng = np.random.default_rng(2)
    counted = {"near": 0, "far": 0, "below": 0, "free": 0}
    for _ in range(200):
        data.qpos[:] = rng.uniform(-3, 3, 6)
        mujoco.mj_forward(robot.model, data)
        room = min(1.0, 6.28 - abs(data.qpos).max())
        whole = room * np.linalg.svd(robot.jacobian(data), compute_uv=False)[-1]
        links = [data.xpos[robot.model.jnt_bodyid[joint]] for joint in range(6)]
        eye = robot.camera(data)
        seen = (links - eye.translation) @ eye.rotation
        depths = [z for x, y, z in seen if z > 0 and np.hypot(x, y) < 0.7 * z]
        if min(links, key=lambda link: link[2])[2] < 0:
            why = "below"
        elif depths:
            why = "near" if max(depths) < 1.0 else "far"
        else:
            why = "free"
        counted[why] += 1
        expected = whole * (1.0 if why == "free" else 0.01)
        assert comfort(robot, data) == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert min(counted[why] for why in ("near", "below", "free")) > 10


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_joints_are_in_the_order_of_the_chain_whatever_that_of_the_motors(tmp_path, order):
    axes = "1 0 0", "0 1 0", "0 0 -1"
    body = '<camera name="eye"/>'
    for name, axis in reversed([*zip("xyz", axes, strict=True)]):
        joint = f'<joint name="{name}" type="slide" axis="{axis}" range="-1 1"/>'
        body = f'<body name="{name}">{joint}<geom size=".02"/>{body}</body>'
    limits = {"x": 0.5, "y": 0.6, "z": 0.7}
    motors = [
        f'<velocity joint="{name}" kv="1e5" ctrlrange="-{most} {most}"/>'
        for name, most in limits.items()
    ]
    actuators = "".join(motors[k] for k in order)
    compiler = '<compiler autolimits="true"/>'
    text = (
        f"<mujoco>{compiler}<worldbody>{body}</worldbody><actuator>{actuators}</actuator></mujoco>"
    )
    (tmp_path / "robot.xml").write_text(text)
    robot, model, _ = built(
        model=str(tmp_path / "robot.xml"), camera="eye", home=((0.1, 0.2, 0.3),)
    )
    assert robot.names == ("x", "y", "z")
    assert robot.fastest.tolist() == [0.5, 0.6, 0.7]
    driven = [model.joint(model.actuator_trnid[k, 0]).name[-1] for k in robot.drives]
    assert driven == ["x", "y", "z"]
