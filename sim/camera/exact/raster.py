"""Rasterisation of triangles with lights and textures, by IEEE arithmetic in a fixed order.

The same scene gives the same bits on every machine: no fast-math, no sum whose order may change.
The loops assign single numbers: with slices they take twice as long to compile. Colours are
interpolated between corners (Gouraud shading), with perspective-correct interpolation and a depth
buffer of 1 / z.
"""

from math import ceil, hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled
from sim.types import Array, Image

Indices = NDArray[np.int64]
Numbers = NDArray[np.int16]
Singles = NDArray[np.float32]
Line = tuple[int, int, int, int, int, int, int, bool]
"""The line in a mipmap level of a texture on which the pixels of a row of the picture lie: offset
of the level in the array of all texels, its width and height [texel]; column of the first pixel and
its change from a pixel to the next, row and its change [1/65536 texel]; and whether the line leaves
the level, which then repeats."""

SEGMENT = 32
"""Pixels of a row along which texture coordinates are interpolated linearly; a division for each
pixel costs twice as much, and the difference cannot be seen."""
FINE_SEGMENT = 8
"""`SEGMENT` where textures are drawn finely: a tilted tag's corners are then found as well as in
OpenGL's pictures."""
NO_AREA = 1e-9
"""Twice the area of the smallest triangle that is drawn [px^2]; a smaller one covers the middle of
a pixel only by rounding."""

# Columns of a corner: position in the camera's frame [m], colour, texture coordinates, position in
# the picture [px], and 1 / z [1/m].
COLOUR = 3
TEXTURE = 6
U = 8
V = 9
NEARNESS = 10
CORNER = 11

# Columns of a light: position, or for a directional light the direction to it; 1 if it has a
# position; its direction; ambient, diffuse and specular colour; attenuation (constant, linear,
# quadratic); cosine of its cone's half angle, and the cone's exponent.
NEAR = 3
ALONG = 4
AMBIENT = 7
DIFFUSE = 10
SPECULAR = 13
FADING = 16
CONE = 19
EXPONENT = 20


@compiled(error_model="numpy")
def dot(a: Array, b: Array) -> float:
    """Return the scalar product of the first three entries of two arrays, summed from the first
    entry on.
    """
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled(error_model="numpy")
def lit(corner: Array, normal: Array, rgba: Array, shine: Array, lights: Array) -> None:
    """Compute the light that a triangle's corner emits and reflects, and write it into the corner
    as its colour (red, green, blue, each at most 1), by the lighting of OpenGL's fixed pipeline
    (Blinn-Phong), as MuJoCo uses it.

    Args:
        corner: Position in the camera's frame [m], colour, texture coordinates, pixel and 1 / z of
            the corner (11,); the position is read, and the colour written.
        normal: Unit normal of the surface (3,) in the camera's frame.
        rgba: Colour of the body (4,), 0 to 1.
        shine: The body's emission, specular reflection and specular exponent (3,).
        lights: The lights (n, 21) in the camera's frame: position, or direction to a directional
            light; 1 with a position, else 0; the light's own direction; ambient, diffuse and
            specular colour; constant, linear and quadratic attenuation; cosine of the cone's half
            angle, and the cone's exponent.
    """
    for k in range(3):
        corner[COLOUR + k] = shine[0] * rgba[k]
    for light in lights:
        # From the corner to the light; a directional light has the same direction everywhere.
        x = light[0] - light[NEAR] * corner[0]
        y = light[1] - light[NEAR] * corner[1]
        z = light[2] - light[NEAR] * corner[2]
        far = sqrt(x * x + y * y + z * z)
        strength = 1.0 / (light[FADING] + far * (light[FADING + 1] + far * light[FADING + 2]))
        along = -(x * light[ALONG] + y * light[ALONG + 1] + z * light[ALONG + 2]) / far
        if along < light[CONE]:
            continue
        if light[EXPONENT] > 0.0:
            strength *= along ** light[EXPONENT]
        facing = max((x * normal[0] + y * normal[1] + z * normal[2]) / far, 0.0)
        gloss = 0.0
        shines = light[SPECULAR] != 0.0 or light[SPECULAR + 1] != 0.0 or light[SPECULAR + 2] != 0.0
        if shine[1] > 0.0 and facing > 0.0 and shines:
            # Blinn's half-way vector between the light and the eye.
            away = sqrt(corner[0] ** 2 + corner[1] ** 2 + corner[2] ** 2)
            a = x / far - corner[0] / away
            b = y / far - corner[1] / away
            c = z / far - corner[2] / away
            towards = max(a * normal[0] + b * normal[1] + c * normal[2], 0.0)
            gloss = shine[1] * (towards / sqrt(a * a + b * b + c * c)) ** shine[2]
        for k in range(3):
            given = light[AMBIENT + k] + facing * light[DIFFUSE + k]
            corner[COLOUR + k] += strength * (rgba[k] * given + gloss * light[SPECULAR + k])
    for k in range(COLOUR, TEXTURE):
        corner[k] = min(corner[k], 1.0)


@compiled(error_model="numpy")
def project(corner: Array, view: Array) -> None:
    """Project a triangle's corner that is in front of the camera: write its pixel (u, v) [px] and 1
    / z [1/m] into the corner.

    Args:
        corner: Position in the camera's frame [m], colour, texture coordinates, pixel and 1 / z
            (11,); the position is read, and pixel and 1 / z are written.
        view: Focal lengths fx, fy and principal point cx, cy (4,) [px].
    """
    corner[NEARNESS] = 1.0 / corner[2]
    corner[U] = view[0] * corner[0] * corner[NEARNESS] + view[2]
    corner[V] = view[1] * corner[1] * corner[NEARNESS] + view[3]


@compiled(error_model="numpy")
def may_cover(corners: Array, height: int, width: int) -> bool:
    """Return False if a triangle certainly covers no pixel centre of the picture, or has nearly no
    area; True if it may cover one.

    Args:
        corners: The triangle's corners (3, 11), in front of the camera and projected by `project`.
        height: Height of the picture [px].
        width: Width of the picture [px].
    """
    u = corners[:, U]
    v = corners[:, V]
    left = min(u[0], u[1], u[2])
    right = max(u[0], u[1], u[2])
    top = min(v[0], v[1], v[2])
    low = max(v[0], v[1], v[2])
    if right < 0.5 or low < 0.5 or left > width - 0.5 or top > height - 0.5:
        return False
    # It lies between two rows or two columns of middles.
    if ceil(top - 0.5) >= ceil(low - 0.5) or ceil(left - 0.5) >= ceil(right - 0.5):
        return False
    area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
    return abs(area) > NO_AREA


@compiled(error_model="numpy")
def gradients(corners: Array, count: int, found: Array) -> None:
    """Compute how 1 / z, and colour and texture coordinates divided by z, change from pixel to
    pixel in a triangle, and write the result into `found`. All of them are linear in the picture
    (perspective-correct interpolation).

    Args:
        corners: The triangle's corners (3, 11), projected by `project`.
        count: Number of gradients: 1 for 1 / z alone, 4 with the colour, 6 with the texture.
        found: For 1 / z, red / z, green / z, blue / z and the two texture coordinates / z, as many
            as `count`: the value at the first corner and its change per pixel along u and along v
            (count, 3); written.
    """
    ax = corners[1, U] - corners[0, U]
    ay = corners[1, V] - corners[0, V]
    bx = corners[2, U] - corners[0, U]
    by = corners[2, V] - corners[0, V]
    part = 1.0 / (ax * by - bx * ay)
    for k in range(count):
        first = corners[0, NEARNESS]
        a = corners[1, NEARNESS]
        b = corners[2, NEARNESS]
        if k > 0:
            first *= corners[0, COLOUR - 1 + k]
            a *= corners[1, COLOUR - 1 + k]
            b *= corners[2, COLOUR - 1 + k]
        found[k, 0] = first
        found[k, 1] = ((a - first) * by - (b - first) * ay) * part
        found[k, 2] = ((b - first) * ax - (a - first) * bx) * part


@compiled(error_model="numpy")
def edges_of(corners: Array, found: Array) -> None:
    """Compute the three edges of a triangle in the picture, each from top to bottom, and write them
    into `found`. Triangles that share an edge get exactly the same numbers for it.

    Args:
        corners: The triangle's corners (3, 11), projected by `project`.
        found: The edges (3, 4), written: for each edge the v of its upper end, the v of its lower
            end, and the u of its upper end [px], and the change of u by v (inf or nan for a
            horizontal edge).
    """
    for i in range(3):
        a = i
        b = i + 1 if i < 2 else 0
        # Always from top to bottom: rounding is then the same for the neighbour's edge.
        if corners[a, V] > corners[b, V]:
            a, b = b, a
        found[i, 0] = corners[a, V]
        found[i, 1] = corners[b, V]
        found[i, 2] = corners[a, U]
        found[i, 3] = (corners[b, U] - corners[a, U]) / (corners[b, V] - corners[a, V])


@compiled(error_model="numpy")
def row_of(edges: Array, middle: float, width: int) -> tuple[int, int]:
    """Return the columns that a triangle covers in a row of pixels: the first one, and the one
    after the last [px]. If the first result is not less than the second, the triangle covers no
    pixel of the row. Triangles that share an edge neither overlap nor leave a gap.

    Args:
        edges: The triangle's edges (3, 4), from `edges_of`.
        middle: Vertical position v of the row's pixel centres [px].
        width: Width of the picture [px].
    """
    left = np.inf
    right = -np.inf
    for i in range(3):
        if edges[i, 0] <= middle < edges[i, 1]:
            at = edges[i, 2] + (middle - edges[i, 0]) * edges[i, 3]
            left = min(left, at)
            right = max(right, at)
    if not left < right:
        return 0, 0
    return int(ceil(max(left, 0.5) - 0.5)), int(ceil(min(right, width + 0.0) - 0.5))  # noqa: RUF046


@compiled(error_model="numpy")
def fill(
    corners: Array,
    edges: Array,
    even: Array,
    body: int,
    texels: Indices,
    levels: Indices,
    fine: bool,
    image: Image,
    nearness: Singles,
    shown: Numbers,
) -> None:
    """Draw a triangle where it is nearer than the surfaces in the depth buffer, with its texture,
    bilinearly interpolated in the nearest mipmap level or, with `fine`, in the two nearest ones.

    A body without a picture has a texture of one pixel.

    Args:
        corners: The triangle's corners (3, 11), in front of the camera and projected by `project`.
        edges: Buffer (3, 4) for `edges_of`.
        even: Buffer (6, 3) for `gradients`.
        body: Number of the triangle's body, to be written into `shown`.
        texels: Pixels of all textures: red, green and blue in one number, 21 bits apart; each
            mipmap level has a border of one pixel, copied from its opposite side.
        levels: Mipmap levels of this texture (n, 4): offset in `texels`, width, height, number of
            levels.
        fine: True: mix two mipmap levels, and compute texture coordinates exactly every 8 px of a
            row; False: use one level, and compute them every 32 px.
        image: The picture, RGB (H, W, 3), written.
        nearness: Depth buffer: 1 / z of the nearest surface (H, W) [1/m], written.
        shown: Number of the body that each pixel shows (H, W), written.
    """
    height, width = nearness.shape
    flat = True
    for k in range(COLOUR, TEXTURE):
        flat &= corners[0, k] == corners[1, k] and corners[0, k] == corners[2, k]
    plain = levels[0, 3] == 1
    segment = FINE_SEGMENT if fine and not plain else SEGMENT
    edges_of(corners, edges)
    gradients(corners, 1 if flat and plain else 4 if plain else 6, even)
    # Colours count in 1 / 4096, weights between pixels in 1 / 64, texture coordinates in 1 / 65536.
    top = max(ceil(min(corners[0, V], corners[1, V], corners[2, V]) - 0.5), 0)
    low = min(ceil(max(corners[0, V], corners[1, V], corners[2, V]) - 0.5), height)
    step = even[0, 1]
    mixed = texels[levels[0, 0]] * 4096
    share = 0
    line = coarse_line = line_in(levels[0], 0.0, 0.0, 0.0, 0.0, 1)
    red = int(4096.0 * corners[0, COLOUR] + 0.5)
    green = int(4096.0 * corners[0, COLOUR + 1] + 0.5)
    blue = int(4096.0 * corners[0, COLOUR + 2] + 0.5)
    for v in range(int(top), int(low)):
        first, end = row_of(edges, v + 0.5, width)
        dv = v + 0.5 - corners[0, V]
        row_near = even[0, 0] + dv * even[0, 2]
        row_s = even[4, 0] + dv * even[4, 2]
        row_t = even[5, 0] + dv * even[5, 2]
        for begin in range(first, end, segment):
            count = min(segment, end - begin)
            near_row = nearness[v, begin : begin + count]
            du = begin + 0.5 - corners[0, U]
            near = row_near + du * step
            ending = near + count * step
            nearest = max(near, ending)
            # Most of what lies behind others is left here: this loop takes many pixels at a time.
            is_seen = False
            for c in range(count):
                is_seen |= nearest > near_row[c]
            if not is_seen:
                continue
            if not plain:
                s = (row_s + du * even[4, 1]) / near
                t = (row_t + du * even[5, 1]) / near
                ds = ((row_s + (du + count) * even[4, 1]) / ending - s) / count
                dt = ((row_t + (du + count) * even[5, 1]) / ending - t) / count
                s_down = (even[4, 2] - s * even[0, 2]) / near
                t_down = (even[5, 2] - t * even[0, 2]) / near
                level, share = level_of(ds, dt, s_down, t_down, levels, fine)
                line = line_in(levels[level], s, t, ds, dt, count)
                if share > 0:
                    coarse_line = line_in(levels[level + 1], s, t, ds, dt, count)
            shown_row = shown[v, begin : begin + count]
            image_row = image[v, begin : begin + count]
            for c in range(count):
                if near > near_row[c]:
                    if not plain:
                        mixed = texel(texels, line, c)
                        if share > 0:
                            mixed = between(mixed, texel(texels, coarse_line, c), share)
                    if not flat:
                        over = 4096.0 / near
                        red = int((even[1, 0] + dv * even[1, 2] + (du + c) * even[1, 1]) * over)
                        green = int((even[2, 0] + dv * even[2, 2] + (du + c) * even[2, 1]) * over)
                        blue = int((even[3, 0] + dv * even[3, 2] + (du + c) * even[3, 1]) * over)
                    image_row[c, 0] = ((mixed & 0x1FFFFF) * red + (1 << 23)) >> 24
                    image_row[c, 1] = (((mixed >> 21) & 0x1FFFFF) * green + (1 << 23)) >> 24
                    image_row[c, 2] = ((mixed >> 42) * blue + (1 << 23)) >> 24
                    near_row[c] = near
                    shown_row[c] = body
                near += step


@compiled(error_model="numpy")
def texel_steps(at: float, change: float, size: int) -> tuple[int, int]:
    """Return the position of a texture coordinate in a mipmap level, and its change from a pixel to
    the next, both in 1/65536 texel.

    The level has a border of one texel on each side. The whole part of the position is the number,
    counted with the border, of the first of the two texels between which the colour is
    interpolated.

    Args:
        at: Texture coordinate, 0 to 1 over the texture.
        change: Its change from a pixel of the picture to the next.
        size: Number of texels of the level, without the border.
    """
    # The border puts pixel 0 into column 1: half a pixel is added, not taken away.
    return int((at * size + 0.5) * 65536.0), int(change * size * 65536.0)


@compiled(error_model="numpy")
def line_in(level: Indices, s: float, t: float, ds: float, dt: float, count: int) -> Line:
    """Return the line in a mipmap level of a texture on which the pixels of a row of the picture
    lie: the level's offset, width and height [texel]; the first pixel's column and its change per
    pixel, the first pixel's row and its change per pixel, both counted with the level's border
    [1/65536 texel]; and whether the line leaves the level, so that the texture is repeated.

    Args:
        level: Offset in the array of all texels, width, height, number of levels (4,).
        s: Texture coordinate of the first pixel from left to right, 0 to 1 over the texture.
        t: Texture coordinate of the first pixel from top to bottom, 0 to 1 over the texture.
        ds: Change of s from a pixel to the next.
        dt: Change of t from a pixel to the next.
        count: Number of pixels.
    """
    wide = level[1]
    tall = level[2]
    x, dx = texel_steps(s, ds, wide)
    y, dy = texel_steps(t, dt, tall)
    turns = is_beyond(x, x + count * dx, wide) or is_beyond(y, y + count * dy, tall)
    return level[0], wide, tall, x, dx, y, dy, turns


@compiled(error_model="numpy")
def texel(texels: Indices, line: Line, c: int) -> int:
    """Return the bilinearly interpolated colour at the c-th pixel (from 0) of a line in a mipmap
    level. Red, green and blue are in one number, 21 bits apart with red lowest, each in units of
    1/4096 grey level. `line` comes from `line_in`, `texels` has the pixels of all textures.
    """
    start, wide, tall, x, dx, y, dy, turns = line
    x += c * dx
    y += c * dy
    column = x >> 16
    row = y >> 16
    if turns:
        column %= wide
        row %= tall
    p = (x >> 10) & 63
    q = (y >> 10) & 63
    pitch = wide + 2
    upper = start + row * pitch + column
    lower = upper + pitch
    over_it = texels[upper] * (64 - p) + texels[upper + 1] * p
    under = texels[lower] * (64 - p) + texels[lower + 1] * p
    return over_it * (64 - q) + under * q


@compiled(error_model="numpy")
def between(near: int, coarse: int, share: int) -> int:
    """Return the weighted mean of two colours in the format of `texel`, with the weights 1 -
    `share` / 64 for `near` and `share` / 64 for `coarse`.
    """
    red = ((near & 0x1FFFFF) * (64 - share) + (coarse & 0x1FFFFF) * share) >> 6
    green = ((near >> 21 & 0x1FFFFF) * (64 - share) + (coarse >> 21 & 0x1FFFFF) * share) >> 6
    blue = ((near >> 42) * (64 - share) + (coarse >> 42) * share) >> 6
    return red | green << 21 | blue << 42


@compiled(error_model="numpy")
def is_beyond(first: int, last: int, size: int) -> bool:
    """Return whether positions in a mipmap level that run from `first` to `last` [1/65536 texel]
    leave the level, which is `size` texels wide (or high).
    """
    return min(first, last) < 0 or max(first, last) > size << 16


@compiled(error_model="numpy")
def level_of(
    s_right: float, t_right: float, s_down: float, t_down: float, levels: Indices, fine: bool
) -> tuple[int, int]:
    """Return the number of a texture's mipmap level (0 is the finest) and a weight.

    With `fine` false it is the level whose texels are nearest in size to the picture's pixels, with
    the weight 0. With `fine` true it is the finer one of the two levels to mix, with the weight of
    the next level [1/64].

    Args:
        s_right: Change of the first texture coordinate from a pixel to the next.
        t_right: Change of the second texture coordinate from a pixel to the next.
        s_down: Change of the first texture coordinate from a row to the next.
        t_down: Change of the second texture coordinate from a row to the next.
        levels: Mipmap levels of the texture (n, 4): offset in the array of all texels, width,
            height, number of levels.
        fine: Whether two levels are to be mixed.
    """
    wide, tall = levels[0, 1], levels[0, 2]
    right = (s_right * wide) ** 2 + (t_right * tall) ** 2
    down = (s_down * wide) ** 2 + (t_down * tall) ** 2
    spread = max(right, down)
    level = 0
    # The middle between two levels is a factor of the square root of 2.
    most = 4.0 if fine else 2.0
    while spread > most and level < levels[0, 3] - 1:
        spread /= 4.0
        level += 1
    if not fine or spread <= 1.0 or level == levels[0, 3] - 1:
        return level, 0
    # Linear instead of a logarithm, whose last bit differs between machines.
    return level, int((sqrt(spread) - 1.0) * 64.0)


@compiled(error_model="numpy")
def cut(seen: Array, faces: Indices, face: int, near: float, view: Array, found: Array) -> int:
    """Clip a triangle at the near plane: write the corners of the part that is farther than the
    plane into `found`, and return their number, 0, 3 or 4.

    Args:
        seen: All corners of the body (n, 11): position in the camera's frame [m], colour, texture
            coordinates, pixel and 1 / z. Those farther than the near plane are projected by
            `project`.
        faces: Numbers of the corners of each triangle (m, 3).
        face: Number of the triangle.
        near: Distance of the near plane [m].
        view: Focal lengths fx, fy and principal point cx, cy (4,) [px].
        found: Corners of the remaining part, projected (4, 11); written.
    """
    count = 0
    for k in range(3):
        a = faces[face, k]
        b = faces[face, k + 1 if k < 2 else 0]
        is_inside = seen[a, 2] > near
        if is_inside:
            for i in range(CORNER):
                found[count, i] = seen[a, i]
            count += 1
        if is_inside != (seen[b, 2] > near):
            part = (near - seen[a, 2]) / (seen[b, 2] - seen[a, 2])
            for i in range(CORNER):
                found[count, i] = seen[a, i] + part * (seen[b, i] - seen[a, i])
            project(found[count], view)
            count += 1
    return count


@compiled(error_model="numpy")
def turn_to_second(part: Array) -> None:
    """Change the corners of a quadrangle (4, 11) in place so that rows 0, 1 and 2, which are the
    first of its two triangles, become the second one: old rows 0, 2 and 3.
    """
    for i in range(CORNER):
        part[1, i] = part[2, i]
        part[2, i] = part[3, i]


@compiled(error_model="numpy")
def is_outside(middle: Array, radius: float, view: Array, height: int, width: int) -> bool:
    """Return True if a ball lies completely behind the camera, or completely beyond one of the four
    planes through the camera and the sides of the picture, so that it cannot be seen.

    Args:
        middle: Centre of the ball (3,) in the camera's frame [m].
        radius: Radius of the ball [m].
        view: Focal lengths and principal point (4,) [px].
        height: Height of the picture [px].
        width: Width of the picture [px].
    """
    # Signed distances from the four planes through the camera and the sides of the picture.
    x, y, z = middle
    fx, fy, cx, cy = view
    return (
        z < -radius
        or -(fx * x + cx * z) > radius * hypot(fx, cx)
        or fx * x - (width - cx) * z > radius * hypot(fx, width - cx)
        or -(fy * y + cy * z) > radius * hypot(fy, cy)
        or fy * y - (height - cy) * z > radius * hypot(fy, height - cy)
    )


@compiled(error_model="numpy")
def draw(
    order: Indices,
    first_row: Indices,
    rows: Array,
    first_face: Indices,
    faces: Indices,
    planes: Array,
    rotations: Array,
    middles: Array,
    radii: Array,
    rgba: Array,
    shine: Array,
    textures: Indices,
    lights: Array,
    near: float,
    view: Array,
    texels: Indices,
    levels: Indices,
    fine: bool,
    image: Image,
    nearness: Singles,
    shown: Numbers,
) -> None:
    """Draw bodies (a scene's geoms, and its sky) into a picture, in a given order. Triangles that
    the camera sees from their back are left out.

    Args:
        order: Numbers of the bodies to draw; the nearest first is fastest.
        first_row: First row of each body in `rows`, and the number of rows (n + 1,).
        rows: Corners: position [m], normal and texture coordinates in the body's frame (r, 8).
        first_face: First triangle of each body in `faces`, and the number of triangles (n + 1,).
        faces: Rows of the corners of each triangle (f, 3).
        planes: Normal and distance of each triangle's plane in the body's frame, both multiplied by
            twice the triangle's area (f, 4).
        rotations: R_camera_body of each body (n, 3, 3).
        middles: Origin of each body in the camera's frame (n, 3) [m].
        radii: Radius of each body around its origin (n,) [m].
        rgba: Colour of each body (n, 4).
        shine: Emission, specular reflection and specular exponent of each body (n, 3).
        textures: Number of each body's texture (n,).
        lights: Lights in the camera's frame (k, 21), with the columns that `lit` lists.
        near: Distance of the near plane [m].
        view: Focal lengths and principal point (4,) [px].
        texels: Pixels of all textures: red, green and blue in one number, 21 bits apart.
        levels: Levels of each texture (t, n, 4): offset in `texels`, width, height, number of
            levels.
        fine: Whether textures are drawn finely: see `fill`.
        image: The picture, RGB (H, W, 3), written.
        nearness: Depth buffer of 1 / z (H, W) [1/m], at first zeros; written.
        shown: Number of the body that each pixel shows (H, W), written.
    """
    height, width = nearness.shape
    seen = np.empty((len(rows), CORNER))
    part = np.empty((4, CORNER))
    edges = np.empty((3, 4))
    even = np.empty((6, 3))
    normal = np.empty(3)
    eye = np.empty(3)
    for body in order:
        R = rotations[body]
        middle = middles[body]
        if is_outside(middle, float(radii[body]), view, height, width):
            continue
        for k in range(3):
            eye[k] = -dot(R[:, k], middle)
        for row in range(first_row[body], first_row[body + 1]):
            corner = seen[row]
            for i in range(3):
                corner[i] = dot(R[i], rows[row]) + middle[i]
                normal[i] = dot(R[i], rows[row, 3:])
            for i in range(TEXTURE, U):
                corner[i] = rows[row, i]
            lit(corner, normal, rgba[body], shine[body], lights)
            if corner[2] > near:
                project(corner, view)
        for face in range(first_face[body], first_face[body + 1]):
            # The camera is behind the triangle's plane: it would see its back.
            if dot(planes[face], eye) <= planes[face, 3]:
                continue
            for k in range(cut(seen, faces, face, near, view, part) - 2):
                # Four corners make two triangles with the first corner in common.
                if k > 0:
                    turn_to_second(part)
                if may_cover(part, height, width):
                    table = levels[textures[body]]
                    fill(part, edges, even, body, texels, table, fine, image, nearness, shown)
