"""Surroundings of the target: the ground below it, walls and clutter around it, and the light.

Each is a table of a scenario, and the defaults leave the room as it is. Clutter that is added lies
flat on the table, so that a target may drive over it; with a height it stands there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, radians, sin
from typing import Annotated, Literal

import mujoco
import numpy as np
from annotated_types import Ge, Le

from sim.files.picture_name import picture_named
from sim.models.paint import PLAIN, SIDES, SQUARE, Colour, add_rectangles, rgba
from sim.models.shapes import lay, picture_of
from sim.ranges import Degrees, File, Length, Share
from sim.types import Array, Image, Pose

WOOD = "wood"
OWN = "picture"
GROUND = "ground"
CLUTTER = "clutter"
WALLS = "walls"
TABLE = "table"
FLOOR = "floor"
TOYS = "toy"
LAMP = "lamp"
"""Names in the room's model: the material of the table is WOOD, the class of its things TOYS."""
GREY = np.full((1, 3), 0.5)
LOWEST = 0.0003
HIGHEST = 0.0009
"""Heights of flat things [m]: each has its own, so that none shines through another."""
LENGTHS = (0.03, 0.11)
"""Longest sides of flat things [m], about those of the shipped targets' parts."""
SLIMMEST = 0.25
"""Least width of a card over its length."""
BAR = 0.15
"""Width of a bar over its length."""
Tile = Annotated[float, Ge(0.01), Le(10)]
"""Width on which a picture lies once [m]."""
LEAST_HEIGHT = 0.25
"""Least height of a standing thing over the largest."""
LEAST_PART = 0.2
MOST_PART = 0.5
"""Side of the part of a picture that an object shows, over the picture's side."""
Number = Annotated[int, Ge(0), Le(500)]
SHAPES = ("disc", "card", "bar")
"""Shapes of the clutter; the draws count them in this order."""
LAMP_STRENGTH = 0.5
"""Strength of the lamp in the room's model: with the head light, all lights sum to 1."""


@dataclass(frozen=True, slots=True)
class GroundConfig:
    """Settings of the picture on the table's top, which is repeated every `tile` metres.

    `kind` is a shipped picture, or "picture" for that in `file`; "wood" covers the whole table
    once.
    """

    kind: Literal[
        "wood", "concrete", "carpet", "checker", "noise", "gravel", "brick", "picture"
    ] = WOOD
    """A shipped picture, or "picture": that of `file`."""
    file: File | None = None
    """The picture for kind = "picture": a file, or "skimage:NAME"."""
    tile: Tile = 0.5
    """Width on which the picture lies once, and beside it again [m]; its height follows from the
    picture. Wood lies once on the whole table."""

    def __post_init__(self) -> None:
        if (self.kind == OWN) != (self.file is not None):
            raise ValueError(f'kind = "{OWN}" and file go together: give both, or neither')

    def picture(self) -> Image:
        """Return the picture that covers the table's top by these settings, RGB, uint8 (H, W, 3).

        Raises:
            ValueError: The picture is missing or cannot be read.
        """
        setting = "ground.kind" if self.file is None else "ground.file"
        return picture_named(self.file or self.kind, "grounds", setting)


@dataclass(frozen=True, slots=True)
class WallsConfig:
    """Settings of four walls around the table with a picture, repeated every `tile` metres.

    They stand `distance` [m] from the table's middle, up to `height` [m] over its top, and are seen
    from inside only. Without a `picture` there are no walls.
    """

    picture: File | None = None
    """A shipped picture's name ("brick"), a file, or "skimage:NAME"; by default there are no
    walls."""
    tile: Tile = 1.0
    """Width on which the picture lies once, and beside it again [m]; its height follows from the
    picture."""
    distance: Annotated[float, Ge(2), Le(10)] = 3.0
    """Distance from the table's middle [m]."""
    height: Annotated[float, Ge(0.1), Le(10)] = 2.5
    """Height of the walls' upper edge over the table [m]; they stand on the floor."""


@dataclass(frozen=True, slots=True)
class ClutterConfig:
    """Settings of the objects and toys on the table.

    `number` objects of a shape lie flat at random places, by the seed of the run, at most `within`
    [m] from the table's middle along x and y. Their colours are random; the share `alike` has
    colours of the target, and with a `picture` each is a box that shows parts of it. With a
    `height` [m] they stand, each with a height of its own up to this one, and hide what is below
    them. `toys` keeps the twelve shipped objects on the table.
    """

    number: Number = 0
    """Number of objects."""
    shape: Literal["mixed", "disc", "card", "bar"] = "mixed"
    """Shape of the objects; "mixed" draws a shape for each."""
    alike: Share = 0.0
    """Share of the objects that have colours of the target."""
    height: Annotated[float, Ge(0), Le(1)] = 0.0
    """Largest height of the objects [m]; each draws its own, from a quarter of it on. From 0.01 on
    all of them are higher than a plate. 0: they are flat, and a target lies above them."""
    within: Length | None = None
    """The middles of the objects are at most this far from the table's middle along x and along y
    [m]; by default they are anywhere on the table."""
    picture: File | None = None
    """A shipped picture's name ("brick"), a file, or "skimage:NAME": each object is then a box that
    shows a part of it on each side; by default objects have plain colours."""
    toys: bool = True
    """Keep the twelve objects that stand on the table."""


@dataclass(frozen=True, slots=True)
class LightConfig:
    """Settings of the lamp over the table: direction [deg], factor on its brightness, colour.

    The direction to the lamp is given by its azimuth, from world x towards y, and its elevation
    over the horizon.
    """

    azimuth_deg: Degrees = 50.2
    """Direction to the lamp, from world x towards y [deg]."""
    elevation_deg: Annotated[float, Ge(5), Le(90)] = 68.7
    """Height of the lamp over the horizon [deg]."""
    strength: Annotated[float, Ge(0), Le(1)] = 1.0
    """Factor on the lamp's brightness."""
    colour: Colour = "#ffffff"
    """Colour of the lamp, as "#rrggbb", or red, green and blue from 0 to 1."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The surroundings of the target: settings of the ground below it, of walls, of clutter
    (objects on the table) and of the light, and the generator that draws the clutter.
    """

    ground: GroundConfig = field(default_factory=GroundConfig)
    walls: WallsConfig = field(default_factory=WallsConfig)
    clutter: ClutterConfig = field(default_factory=ClutterConfig)
    light: LightConfig = field(default_factory=LightConfig)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    """Source of the clutter's random numbers."""

    def furnish(self, room: mujoco.MjSpec, target: mujoco.MjSpec) -> None:
        """Change a room's model, in place, as these settings say: add ground, walls and clutter,
        remove the shipped objects from the table, and set the lamp.

        Args:
            room: Model of scenes/room.xml, which is changed.
            target: Model of the target, whose colours some of the clutter may have.

        Raises:
            ValueError: A picture cannot be read, or a colour is not valid.
        """
        if self.ground.kind != WOOD:
            _cover(room, self.ground)
        if self.walls.picture is not None:
            _build_walls(room, self.walls, self.walls.picture)
        if self.light != LightConfig():
            _light(room, self.light)
        if not self.clutter.toys:
            for geom in [g for g in room.worldbody.geoms if g.classname.name == TOYS]:
                room.delete(geom)
        if self.clutter.number:
            _strew(room, self.clutter, colours_of(target), self.rng)


def _cover(room: mujoco.MjSpec, ground: GroundConfig) -> None:
    material = room.material(WOOD)
    picture = ground.picture()
    lay(room, picture, material, GROUND)
    material.texrepeat = 2 * room.geom(TABLE).size[:2] / _tile(picture, ground.tile)


def _tile(picture: Image, width: float) -> Array:
    """Return width and height [m] of a picture (H, W, 3) that is shown with this width."""
    return np.array([width, width * (picture.shape[0] / picture.shape[1])])


def _build_walls(room: mujoco.MjSpec, walls: WallsConfig, picture_name: str) -> None:
    """Add four walls that face the table."""
    picture = picture_named(picture_name, "grounds", "walls.picture")
    floor = float(room.geom(FLOOR).pos[2])
    half = np.array([walls.distance, (walls.height - floor) / 2])
    sides = SIDES[2:]
    outwards = -np.cross(sides[:, 0], sides[:, 1])
    middles = walls.distance * outwards + (0, 0, floor + half[1])
    corners = middles[:, None] + SQUARE * half @ sides
    places = (SQUARE + 1) * half / _tile(picture, walls.tile)
    add_rectangles(room, WALLS, corners, places, picture)


def _light(room: mujoco.MjSpec, light: LightConfig) -> None:
    azimuth = radians(light.azimuth_deg)
    elevation = radians(light.elevation_deg)
    lamp = room.light(LAMP)
    level = cos(elevation)
    lamp.dir = [-level * cos(azimuth), -level * sin(azimuth), -sin(elevation)]
    lamp.diffuse = LAMP_STRENGTH * light.strength * np.array(rgba(light.colour)[:3])


def colours_of(target: mujoco.MjSpec) -> Array:
    """Return colours (n, 3), RGB from 0 to 1, that occur in a target's model: for each geom its
    plain colour, or, if it has a picture, the colours of about 16 of the picture's pixels. For a
    model without geoms it is grey.
    """
    model = target.copy().compile()
    found = list[Array]()
    for geom in range(model.ngeom):
        material = model.geom_matid[geom]
        textures = [] if material < 0 else [t for t in model.mat_texid[material] if t >= 0]
        if textures:
            pixels = picture_of(model, textures[0]).reshape(-1, 3)
            found.append(pixels[:: max(1, len(pixels) // 16)] / 255.0)
        else:
            plain = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
            found.append(plain[None, :3].astype(float))
    return np.concatenate(found or [GREY])


def _strew(
    room: mujoco.MjSpec, clutter: ClutterConfig, alike: Array, rng: np.random.Generator
) -> None:
    within = clutter.within
    reach = room.geom(TABLE).size[:2] if within is None else np.array([within, within])
    boxes = list[Array]()
    for i in range(clutter.number):
        shape = SHAPES[rng.integers(len(SHAPES))]
        place = rng.uniform(-reach, reach)
        turn = rng.uniform(0.0, 180.0)
        length = rng.uniform(*LENGTHS)
        slim = rng.uniform(SLIMMEST, 1.0)
        own, of_target = rng.uniform(size=3), alike[rng.integers(len(alike))]
        colour = of_target if rng.uniform() < clutter.alike else own
        height = LOWEST + (HIGHEST - LOWEST) * (i + 1) / clutter.number
        if clutter.height:
            height += clutter.height * rng.uniform(LEAST_HEIGHT, 1.0)
        if clutter.picture is not None:
            boxes.append(_sides_of_box(place, radians(turn), [length, slim * length, height]))
            continue
        room.worldbody.add_geom(
            pos=[*place, height / 2],
            euler=[0.0, 0.0, turn],
            rgba=[*colour, 1.0],
            **_geom(shape if clutter.shape == "mixed" else clutter.shape, length, slim, height),
            **PLAIN | {"group": 0},
        )

    if clutter.picture is not None:
        picture = picture_named(clutter.picture, "grounds", "clutter.picture")
        sides = np.concatenate(boxes)
        parts = np.array([_part(rng) for _ in sides])
        add_rectangles(room, CLUTTER, sides, parts, picture)


def _sides_of_box(place: Array, turn: float, size: Sequence[float]) -> Array:
    """Return the corners (5, 4, 3) [m] of the upper side and the four walls of a box that stands on
    the table, counter-clockwise as seen from outside.

    Args:
        place: Its middle on the table (2,) [m].
        turn: Direction of its length, from world x towards y [rad].
        size: Length, width and height [m].
    """
    seen = SIDES[[0, 2, 3, 4, 5]]
    outwards = np.cross(seen[:, 0], seen[:, 1])
    corners = (outwards[:, None] + SQUARE @ seen + (0, 0, 1)) * np.array(size) / 2
    return Pose.planar(float(place[0]), float(place[1]), turn).apply(corners)


def _part(rng: np.random.Generator) -> Array:
    """Return the corners (4, 2) of a random part of a picture, 0 to 1 from its left and bottom."""
    side = rng.uniform(LEAST_PART, MOST_PART)
    corner = rng.uniform(0.0, 1.0 - side, 2)
    return corner + side * (SQUARE + 1) / 2


def _geom(shape: str, length: float, slim: float, height: float) -> dict[str, object]:
    """Return the type and half sizes [m] of an object on the table, as arguments of `add_geom`.

    Args:
        shape: One of `SHAPES`.
        length: Diameter of a disc, or longest side of a card or bar [m].
        slim: Width of a card over its length.
        height: Height of the object [m].
    """
    if shape == "disc":
        size: Sequence[float] = [length / 2, height / 2, 0]
        return {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "size": size}
    width = length * (slim if shape == "card" else BAR)
    return {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [length / 2, width / 2, height / 2]}
