"""Ground, clutter and light: what they change in the picture, and what they refuse."""

import mujoco
import numpy as np
import pytest

import servo
from servo.mistake import Mistake
from sim.camera.renderer import Unseen
from sim.models.assembly import build_model, with_stands
from sim.models.shapes import lay
from sim.surroundings import ClutterConfig, GroundConfig, LightConfig, Surroundings, colours_of
from sim.world import World, WorldParts


def last_step(*changes):
    few = ["run.duration=0.05", "tracker.kind=frozen", *changes]
    return list(servo.run(servo.load("still", few)))[-1]


def picture(*changes):
    return last_step(*changes).frame.image.astype(int)


def model(surroundings):
    scenario = servo.load("still")
    rng = np.random.default_rng(0)
    robot, target = scenario.robot.build(rng), scenario.target.build(rng)
    return build_model(480.0, scenario.camera, robot, target, (), surroundings)


def test_the_defaults_leave_the_room_as_it_is():
    plain, same = model(None), model(Surroundings())
    assert plain.ngeom == same.ngeom
    np.testing.assert_array_equal(plain.tex_data, same.tex_data)
    np.testing.assert_array_equal(plain.light_dir, same.light_dir)


@pytest.mark.parametrize("kind", ["concrete", "carpet", "checker", "noise"])
def test_a_ground_changes_the_table_and_not_the_target(kind):
    before, after = picture(), picture(f"ground.kind={kind}")
    u, v = last_step().truth.centre.astype(int)
    middle = np.s_[v - 3 : v + 3, u - 3 : u + 3]
    np.testing.assert_array_equal(before[middle], after[middle])
    assert (np.abs(before - after).max(axis=2) > 8).mean() > 0.5


def test_a_tile_is_repeated_after_its_side():
    found = model(Surroundings(GroundConfig("checker", tile=0.25)))
    material = found.material("wood")
    np.testing.assert_allclose(material.texrepeat, [12.0, 9.6])  # 3.0 x 2.4 m


def test_a_picture_of_ones_own_covers_the_table(tmp_path, monkeypatch):
    import cv2

    monkeypatch.chdir(tmp_path)
    cv2.imwrite("red.png", np.full((8, 8, 3), (0, 0, 250), np.uint8))
    corner = picture("ground.kind=picture", "ground.file=red.png")[5, 5]
    assert corner[0] > 100
    assert corner[1:].max() < 10


def test_clutter_is_drawn_by_the_seed_and_lies_under_the_target():
    def places(seed, number):
        rng = np.random.default_rng(seed)
        surroundings = Surroundings(clutter=ClutterConfig(number, toys=False), rng=rng)
        found = model(surroundings)
        return np.sort(found.geom_pos[found.geom_pos[:, 2] < 0.0005, 0])

    plain = model(Surroundings(clutter=ClutterConfig(0, toys=False)))
    more = model(Surroundings(clutter=ClutterConfig(30, toys=False)))
    assert more.ngeom - plain.ngeom == 30
    assert model(None).ngeom - plain.ngeom == 12
    np.testing.assert_array_equal(places(1, 30), places(1, 30))
    assert not np.array_equal(places(1, 30), places(2, 30))


def test_things_alike_have_colours_of_the_target():
    target = servo.load("still", ["target.kind=box", "target.colour=#ff0000"]).target
    spec = target.build(np.random.default_rng(0)).spec
    np.testing.assert_allclose(colours_of(spec), [[1.0, 0.0, 0.0]])
    plate = servo.load("still", ["target.kind=plate"]).target.build(np.random.default_rng(0)).spec
    assert len(np.unique(colours_of(plate), axis=0)) > 8


@pytest.mark.parametrize(
    ("pixel", "colour"), [((51,), (51, 51, 51)), ((255, 0, 51, 102), (255, 0, 51))]
)
def test_colours_of_a_target_whose_picture_has_one_or_four_channels(pixel, colour):
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(size=(0.1, 0.1, 0.1), material="m")
    lay(spec, np.full((8, 10, len(pixel)), pixel, np.uint8), spec.add_material(name="m"), "t")
    np.testing.assert_allclose(colours_of(spec), np.tile(colour, (16, 1)) / 255)


def test_a_target_without_geoms_is_grey():
    np.testing.assert_array_equal(colours_of(mujoco.MjSpec()), [[0.5, 0.5, 0.5]])


@pytest.mark.parametrize(("shape", "discs"), [("disc", 5), ("card", 0)])
def test_objects_have_the_stated_shape(shape, discs):
    def cylinders(found):
        return np.count_nonzero(found.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER)

    strewn = model(Surroundings(clutter=ClutterConfig(number=5, shape=shape)))
    assert cylinders(strewn) - cylinders(model(None)) == discs


def test_light_comes_from_where_it_is_said_and_has_its_colour():
    light = LightConfig(azimuth_deg=90.0, elevation_deg=30.0, strength=0.5, colour="#ff0000")
    lamp = model(Surroundings(light=light)).light("lamp")
    np.testing.assert_allclose(lamp.dir, [0.0, -np.cos(np.pi / 6), -0.5], atol=1e-9)
    np.testing.assert_allclose(lamp.diffuse, [0.25, 0.0, 0.0], atol=1e-7)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("ground.kind=picture", 'kind = "picture" and file go together: give both, or neither'),
        ("ground.file=x.png", 'kind = "picture" and file go together: give both, or neither'),
        ("clutter.alike=2", "clutter.alike = 2: input should be less than or equal to 1"),
        ("light.elevation_deg=1", "light.elevation_deg = 1: input should be greater than"),
    ],
)
def test_a_mistake_is_named(change, sentence):
    with pytest.raises(Mistake) as found:
        picture(change)
    assert sentence in str(found.value)


def test_the_ground_may_be_drawn():
    changes = ['vary.ground.kind={choice=["carpet","noise"]}', "vary.clutter.number={choice=[1,9]}"]
    kinds = {servo.load("still", changes, seed=seed).ground.kind for seed in range(1, 9)}
    assert kinds == {"carpet", "noise"}


def test_base_and_camera_in_the_room_stand_on_columns():
    """In recordings and films; the columns end where they carry something."""
    arm = ["robot.kind=mjcf", "robot.base=[0.2, 0.5, 0.6, -90]"]
    stands = ["camera.mounted=world", "camera.pose=[0.3, -1.6, 0.8, -100, 0, 0]"]
    found = servo.load("hand_tag", [*arm, *stands])
    rng = np.random.default_rng(0)
    parts = WorldParts(
        found.robot.build(rng), found.target.build(rng), found.motion.build(rng), (), found.camera
    )
    world = World(parts, rng, renderer=Unseen)
    drawn = with_stands(world.model)
    shown = np.flatnonzero((drawn.geom_group == 0) & (world.model.geom_group != 0))
    columns = [i for i in shown if drawn.geom_type[i] == mujoco.mjtGeom.mjGEOM_CYLINDER]
    tops = [drawn.geom_pos[i] + [0, 0, drawn.geom_size[i, 1]] for i in columns]
    feet = [drawn.geom_pos[i, 2] - drawn.geom_size[i, 1] for i in columns]
    np.testing.assert_allclose(tops, [[0.2, 0.5, 0.6], [0.3, -1.6, 0.8]])
    np.testing.assert_allclose(feet, [0.0, -0.75], atol=1e-12)  # the table, and the floor beside it
    assert len(shown) == 3  # the standing camera's body is the third
