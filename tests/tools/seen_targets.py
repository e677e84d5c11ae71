"""Targets as the camera sees them, and small meshes to make them of."""

import struct

import numpy as np
import pytest

from sim.camera.camera import CameraConfig
from sim.camera.choice import renderer_of
from sim.motions import still
from sim.robots import gantry
from sim.world import World, WorldConfig, WorldParts

RNG = np.random.default_rng()
MIDDLE = np.array([160.0, 120.0])
CUBE = """
v 0 0 0
v 300 0 0
v 300 100 0
v 0 100 0
v 0 0 50
v 300 0 50
v 300 100 50
v 0 100 50
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""
"""A box of 300 x 100 x 50 mm, its faces counter-clockwise as seen from outside."""
SHEET = "v -1 -2 0\nv 1 -2 0\nv 1 2 0\nv -1 2 0\n"
PLACED = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def build(config):
    return config.build(np.random.default_rng(0))


@pytest.fixture
def show_target(request):
    """Shows a target to the camera; the picture and the truth."""

    def show(config, theta=0.0, disturbances=(), x=0.0, renderer="opengl"):
        parts = WorldParts(
            gantry.Config().build(RNG),
            build(config),
            still.Config(x=x).build(RNG),
            disturbances,
            config=WorldConfig(visibility=True),
        )
        world = World(parts, np.random.default_rng(1), renderer_of(CameraConfig(renderer=renderer)))
        request.addfinalizer(world.close)
        assert world.start(MIDDLE, theta, 1.0)
        return world.look().image, world.truth(), world

    return show


@pytest.fixture
def model_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def mesh_file_of(folder, text=CUBE, name="part.obj"):
    (folder / name).write_text(text)
    return name


def rectangle_of(target):
    corners = target.outline
    return [*np.ptp(corners[:, :2], axis=0), corners[0, 2], *corners.mean(axis=0)[:2]]


def stl_of(faces, count=None):
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, *np.ravel(face), 0) for face in faces)
    return b"\0" * 80 + struct.pack("<I", len(faces) if count is None else count) + rows


def stl_text(faces):
    loops = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corner) for corner in face)
        + "endloop\nendfacet\n"
        for face in faces
    )
    return f"solid part\n{loops}endsolid part\n".encode()


FACES = [[(0, 0, 0), (40, 0, 0), (40, 10, 0)], [(0, 0, 0), (40, 10, 0), (0, 10, 0)]]
