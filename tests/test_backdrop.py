"""Sky and floor are left out of a picture where the table hides them: it has the same bits."""

from importlib import resources

import mujoco
import numpy as np
import pytest

from sim.camera.exact.renderer import ExactRenderer
from sim.camera.renderer import OpenGLRenderer
from sim.types import Camera

VIEW = Camera(fx=150.0, fy=150.0, cx=80.0, cy=60.0, width=160, height=120)


def room(table):
    """The room with a camera that can be put anywhere, and its table under a name."""
    with resources.as_file(resources.files("scenes")) as folder:
        spec = mujoco.MjSpec.from_file(str(folder / "room.xml"))
        spec.geom("table").name = table
        hand = spec.worldbody.add_body(name="hand", mocap=True)
        hand.add_camera(name="eye", fovy=45)
        return spec.compile()


def poses():
    """Cameras over the table: in its middle and near its edges, level and tilted to the sky."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        place = rng.uniform([-1.7, -1.4, 0.1], [1.7, 1.4, 1.5])
        turn = np.array([*rng.uniform(-1.2, 1.2, 2), rng.uniform(-3, 3)])
        yield place, turn * rng.choice([0.0, 0.3, 1.0])


def pictures(model, make=ExactRenderer):
    data = mujoco.MjData(model)
    renderer = make(model, "eye", VIEW)
    groups = model.geom_group.copy()
    seen = []
    for place, turn in poses():
        data.mocap_pos[-1] = place
        mujoco.mju_euler2Quat(data.mocap_quat[-1], turn, "xyz")
        mujoco.mj_forward(model, data)
        seen.append(renderer.begin(data)())
        assert (model.geom_group == groups).all()
    renderer.close()
    return np.array(seen)


@pytest.mark.parametrize(
    "make", [pytest.param(OpenGLRenderer, marks=pytest.mark.opengl), ExactRenderer]
)
def test_what_the_table_hides_need_not_be_drawn(make):
    hiding, all_of_it = (pictures(room(table), make) for table in ("table", "all_is_drawn"))
    np.testing.assert_array_equal(hiding, all_of_it)


def test_half_of_these_pictures_show_nothing_but_the_table_and_what_is_on_it():
    model = room("table")
    floor = model.geom("floor").id
    table = pictures(model)
    model.geom_rgba[floor] = 1.0, 0.0, 1.0, 1.0
    same = (pictures(model) == table).all(axis=(1, 2, 3))
    assert 15 <= same.sum() <= 45, "few pictures are filled by the table, or nearly all"
