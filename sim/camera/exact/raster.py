"""Triangles into a picture, with IEEE arithmetic in a fixed order.

The same scene gives the same bits on every machine: no fast-math, no sum whose order may change.
"""

# pyright: reportUnknownMemberType=false, reportUntypedFunctionDecorator=false
# numba's decorators have no types.
from math import ceil, floor, hypot, log2, sqrt

import numba
import numpy as np
from numpy.typing import NDArray

from sim.types import Array, Image

Indices = NDArray[np.int64]

SEGMENT = 32
"""Pixels of a row between which texture coordinates go evenly; a division for each pixel costs
twice as much, and nothing is to be seen of the difference."""
NO_AREA = 1e-9
"""A triangle below this covers no pixel's middle, but by rounding [px^2]."""

# Columns of a corner: its place in the camera's frame, its colour, its place in the texture.
COLOUR = 3
TEXTURE = 6
CORNER = 8

# Columns of a light.
AT = 0
"""Direction towards it, or its place."""
NEAR = 3
"""1 for a lamp at a place, 0 for one that is far away."""
ALONG = 4
AMBIENT = 7
DIFFUSE = 10
SPECULAR = 13
FADING = 16
"""Constant, linear and quadratic attenuation."""
CONE = 19
"""Cosine of the cone's half angle; -1 where it shines to all sides."""
EXPONENT = 20
LIGHT = 21

compiled = numba.njit(cache=True, nogil=True, error_model="numpy")


@compiled
def lit(place: Array, normal: Array, rgba: Array, shine: Array, lights: Array, out: Array) -> None:
    """Write the colour of a corner: the sum of what the lights give, at most 1 a channel.

    Args:
        place: In the camera's frame (3,) [m].
        normal: In the camera's frame (3,).
        rgba: Colour of the body (4,).
        shine: Its emission, specular reflection, and exponent of that (3,).
        lights: A row for each (n, 21), in the camera's frame.
        out: The colour, 0 to 1 (3,).
    """
    emission, specular, exponent = shine
    for k in range(3):
        out[k] = emission * rgba[k]
    to_light = np.empty(3)
    for light in lights:
        strength = 1.0
        for k in range(3):
            to_light[k] = light[AT + k]
        if light[NEAR] > 0.0:
            for k in range(3):
                to_light[k] -= place[k]
            far = sqrt(to_light[0] ** 2 + to_light[1] ** 2 + to_light[2] ** 2)
            along = 0.0
            for k in range(3):
                to_light[k] /= far
                along -= to_light[k] * light[ALONG + k]
            strength /= light[FADING] + far * (light[FADING + 1] + far * light[FADING + 2])
            if light[CONE] > -1.0:
                strength *= along ** light[EXPONENT] if along >= light[CONE] else 0.0
        facing = to_light[0] * normal[0] + to_light[1] * normal[1] + to_light[2] * normal[2]
        for k in range(3):
            given = light[AMBIENT + k] + max(facing, 0.0) * light[DIFFUSE + k]
            out[k] += strength * rgba[k] * given
        if specular > 0.0 and facing > 0.0 and light[SPECULAR : SPECULAR + 3].any():
            # The half-way vector between the light and the eye, as OpenGL has it.
            far = sqrt(place[0] ** 2 + place[1] ** 2 + place[2] ** 2)
            for k in range(3):
                to_light[k] -= place[k] / far
            cosine = to_light[0] * normal[0] + to_light[1] * normal[1] + to_light[2] * normal[2]
            cosine /= sqrt(to_light[0] ** 2 + to_light[1] ** 2 + to_light[2] ** 2)
            for k in range(3):
                out[k] += strength * specular * max(cosine, 0.0) ** exponent * light[SPECULAR + k]
    for k in range(3):
        out[k] = min(out[k], 1.0)


@compiled
def project(corners: Array, view: Array, spots: Array, height: int, width: int) -> bool:
    """Write where the corners of a triangle are seen; return whether it may cover a pixel's middle.

    Args:
        corners: In front of the camera (3, 8).
        view: Focal lengths and principal point (4,) [px].
        spots: Place in the picture, and 1 / z (3, 3) [px, 1/m].
        height: Of the picture [px].
        width: Of the picture [px].
    """
    for k in range(3):
        spots[k, 2] = 1.0 / corners[k, 2]
        spots[k, 0] = view[0] * corners[k, 0] * spots[k, 2] + view[2]
        spots[k, 1] = view[1] * corners[k, 1] * spots[k, 2] + view[3]
    u = spots[:, 0]
    v = spots[:, 1]
    left = min(u[0], u[1], u[2])
    right = max(u[0], u[1], u[2])
    top = min(v[0], v[1], v[2])
    low = max(v[0], v[1], v[2])
    if right < 0.5 or low < 0.5 or left > width - 0.5 or top > height - 0.5:
        return False
    if ceil(top - 0.5) >= ceil(low - 0.5) or ceil(left - 0.5) >= ceil(right - 0.5):
        return False
    area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
    return abs(area) > NO_AREA


@compiled
def gradients(corners: Array, spots: Array, count: int, found: Array) -> None:
    """Write what changes evenly over the picture: 1 / z, and a corner's values over z.

    Args:
        corners: (3, 8).
        spots: (3, 3).
        count: How many: 1 / z alone, with the colour 4, and with the texture 6.
        found: Value at the first corner, and its change by u and by v (count, 3).
    """
    ax = spots[1, 0] - spots[0, 0]
    ay = spots[1, 1] - spots[0, 1]
    bx = spots[2, 0] - spots[0, 0]
    by = spots[2, 1] - spots[0, 1]
    area = ax * by - bx * ay
    for k in range(count):
        first = spots[0, 2]
        a = spots[1, 2]
        b = spots[2, 2]
        if k > 0:
            first *= corners[0, COLOUR - 1 + k]
            a *= corners[1, COLOUR - 1 + k]
            b *= corners[2, COLOUR - 1 + k]
        found[k, 0] = first
        found[k, 1] = ((a - first) * by - (b - first) * ay) / area
        found[k, 2] = ((b - first) * ax - (a - first) * bx) / area


@compiled
def row_of(spots: Array, middle: float, width: int) -> tuple[int, int]:
    """First column of a triangle in a row, and the one after the last.

    An edge gives the same crossing for both triangles that share it, so that none overlap and no
    gap is left between them.
    """
    left = np.inf
    right = -np.inf
    for i in range(3):
        a = i
        b = i + 1 if i < 2 else 0
        if spots[a, 1] > spots[b, 1]:
            a, b = b, a
        if spots[a, 1] <= middle < spots[b, 1]:
            slope = (spots[b, 0] - spots[a, 0]) / (spots[b, 1] - spots[a, 1])
            at = spots[a, 0] + (middle - spots[a, 1]) * slope
            left = min(left, at)
            right = max(right, at)
    if not left < right:
        return 0, 0
    return int(ceil(max(left, 0.5) - 0.5)), int(ceil(min(right, width + 0.0) - 0.5))


@compiled
def paint(
    corners: Array,
    spots: Array,
    even: Array,
    body: int,
    alpha: float,
    image: Image,
    nearness: Array,
    shown: Indices,
) -> None:
    """Draw a triangle that has no texture.

    Args:
        corners: (3, 8).
        spots: (3, 3).
        even: Room for what changes evenly (6, 3).
        body: Its number.
        alpha: Below 1 what is behind it shines through, and it hides nothing.
        image: The picture (H, W, 3).
        nearness: 1 / z of what is nearest (H, W) [1/m].
        shown: Numbers of the bodies (H, W).
    """
    height, width = nearness.shape
    flat = True
    for k in range(COLOUR, TEXTURE):
        flat &= corners[0, k] == corners[1, k] and corners[0, k] == corners[2, k]
    gradients(corners, spots, 1 if flat else 4, even)
    colour = np.empty(3)
    for k in range(3):
        colour[k] = 255.0 * corners[0, COLOUR + k]
    top = min(spots[0, 1], spots[1, 1], spots[2, 1])
    low = max(spots[0, 1], spots[1, 1], spots[2, 1])
    for v in range(max(int(ceil(top - 0.5)), 0), min(int(ceil(low - 0.5)), height)):
        begin, end = row_of(spots, v + 0.5, width)
        dv = v + 0.5 - spots[0, 1]
        near = even[0, 0] + dv * even[0, 2] + (begin + 0.5 - spots[0, 0]) * even[0, 1]
        for u in range(begin, end):
            if near > nearness[v, u]:
                if not flat:
                    du = u + 0.5 - spots[0, 0]
                    for k in range(3):
                        value = even[1 + k, 0] + dv * even[1 + k, 2] + du * even[1 + k, 1]
                        colour[k] = min(max(255.0 * value / near, 0.0), 255.0)
                if alpha < 1.0:
                    for k in range(3):
                        image[v, u, k] = int(alpha * colour[k] + (1 - alpha) * image[v, u, k] + 0.5)
                else:
                    nearness[v, u] = near
                    shown[v, u] = body
                    for k in range(3):
                        image[v, u, k] = int(colour[k] + 0.5)
            near += even[0, 1]


@compiled
def paper(
    corners: Array,
    spots: Array,
    even: Array,
    body: int,
    texels: Indices,
    levels: Indices,
    image: Image,
    nearness: Array,
    shown: Indices,
) -> None:
    """Draw a triangle with its texture, between the four nearest pixels of the fitting level.

    Args:
        corners: (3, 8).
        spots: (3, 3).
        even: Room for what changes evenly (6, 3).
        body: Its number.
        texels: Red, green and blue in one number each, 21 bits apart; a level has a border of a
            pixel from its other side.
        levels: Of this texture: place in `texels`, width, height, and how many there are (n, 4).
        image: The picture (H, W, 3).
        nearness: 1 / z of what is nearest (H, W) [1/m].
        shown: Numbers of the bodies (H, W).
    """
    height, width = nearness.shape
    flat = True
    for k in range(COLOUR, TEXTURE):
        flat &= corners[0, k] == corners[1, k] and corners[0, k] == corners[2, k]
    gradients(corners, spots, 6, even)
    # Colours count in 1 / 4096, weights between pixels in 1 / 64, texture coordinates in 1 / 65536.
    red = int(4096.0 * corners[0, COLOUR] + 0.5)
    green = int(4096.0 * corners[0, COLOUR + 1] + 0.5)
    blue = int(4096.0 * corners[0, COLOUR + 2] + 0.5)
    turns_s = floor(min(corners[0, TEXTURE], corners[1, TEXTURE], corners[2, TEXTURE]))
    turns_t = floor(min(corners[0, TEXTURE + 1], corners[1, TEXTURE + 1], corners[2, TEXTURE + 1]))
    top = min(spots[0, 1], spots[1, 1], spots[2, 1])
    low = max(spots[0, 1], spots[1, 1], spots[2, 1])
    step = even[0, 1]
    for v in range(max(int(ceil(top - 0.5)), 0), min(int(ceil(low - 0.5)), height)):
        first, end = row_of(spots, v + 0.5, width)
        dv = v + 0.5 - spots[0, 1]
        du = first + 0.5 - spots[0, 0]
        row_near = even[0, 0] + dv * even[0, 2]
        row_s = even[4, 0] + dv * even[4, 2]
        row_t = even[5, 0] + dv * even[5, 2]
        near = row_near + du * step
        s = (row_s + du * even[4, 1]) / near
        t = (row_t + du * even[5, 1]) / near
        for begin in range(first, end, SEGMENT):
            count = min(SEGMENT, end - begin)
            du = begin + count + 0.5 - spots[0, 0]
            ending = row_near + du * step
            ds = ((row_s + du * even[4, 1]) / ending - s) / count
            dt = ((row_t + du * even[5, 1]) / ending - t) / count
            s_down = (even[4, 2] - s * even[0, 2]) / near
            t_down = (even[5, 2] - t * even[0, 2]) / near
            level = level_of(ds, dt, s_down, t_down, levels)
            start, wide, tall = levels[level, 0], levels[level, 1], levels[level, 2]
            pitch = wide + 2
            # The border puts pixel 0 into column 1: half a pixel is added, not taken away.
            x = int(((s - turns_s) * wide + 0.5) * 65536.0)
            y = int(((t - turns_t) * tall + 0.5) * 65536.0)
            dx = int(ds * wide * 65536.0)
            dy = int(dt * tall * 65536.0)
            near_row = nearness[v, begin : begin + count]
            shown_row = shown[v, begin : begin + count]
            image_row = image[v, begin : begin + count]
            for c in range(count):
                if near > near_row[c]:
                    column = x >> 16
                    row = y >> 16
                    if column < 0 or column > wide:
                        column %= wide
                    if row < 0 or row > tall:
                        row %= tall
                    p = (x >> 10) & 63
                    q = (y >> 10) & 63
                    both = p * q
                    upper = start + row * pitch + column
                    lower = upper + pitch
                    mixed = (
                        texels[upper] * (4096 - 64 * p - 64 * q + both)
                        + texels[upper + 1] * (64 * p - both)
                        + texels[lower] * (64 * q - both)
                        + texels[lower + 1] * both
                    )
                    if not flat:
                        over = 4096.0 / near
                        du = begin + c + 0.5 - spots[0, 0]
                        red = int((even[1, 0] + dv * even[1, 2] + du * even[1, 1]) * over)
                        green = int((even[2, 0] + dv * even[2, 2] + du * even[2, 1]) * over)
                        blue = int((even[3, 0] + dv * even[3, 2] + du * even[3, 1]) * over)
                    image_row[c, 0] = ((mixed & 0x1FFFFF) * red + (1 << 23)) >> 24
                    image_row[c, 1] = (((mixed >> 21) & 0x1FFFFF) * green + (1 << 23)) >> 24
                    image_row[c, 2] = ((mixed >> 42) * blue + (1 << 23)) >> 24
                    near_row[c] = near
                    shown_row[c] = body
                near += step
                x += dx
                y += dy
            near = ending
            s += count * ds
            t += count * dt


@compiled
def level_of(s_right: float, t_right: float, s_down: float, t_down: float, levels: Indices) -> int:
    """The level of a texture whose pixels are nearest in size to the picture's.

    Args:
        s_right: Change of the first texture coordinate from a pixel to the next.
        t_right: Likewise of the second.
        s_down: Change of the first to the next row.
        t_down: Likewise of the second.
        levels: As for `paper` (n, 4).
    """
    wide, tall = levels[0, 1], levels[0, 2]
    right = (s_right * wide) ** 2 + (t_right * tall) ** 2
    down = (s_down * wide) ** 2 + (t_down * tall) ** 2
    spread = max(right, down)
    if spread <= 1.0:
        return 0
    return int(min(0.5 * log2(spread) + 0.5, levels[0, 3] - 1.0))


@compiled
def cut(corners: Array, near: float, found: Array) -> int:
    """Write the part of a triangle that is in front of the camera; return its number of corners."""
    count = 0
    for k in range(3):
        a = corners[k]
        b = corners[k + 1 if k < 2 else 0]
        if a[2] > near:
            found[count] = a
            count += 1
        if (a[2] > near) != (b[2] > near):
            part = (near - a[2]) / (b[2] - a[2])
            for i in range(CORNER):
                found[count, i] = a[i] + part * (b[i] - a[i])
            count += 1
    return count


@compiled
def is_outside(middle: Array, radius: float, view: Array, height: int, width: int) -> bool:
    """Whether a ball in the camera's frame lies beside the picture or behind the camera."""
    x, y, z = middle
    fx, fy, cx, cy = view
    return (
        z < -radius
        or -(fx * x + cx * z) > radius * hypot(fx, cx)
        or fx * x - (width - cx) * z > radius * hypot(fx, width - cx)
        or -(fy * y + cy * z) > radius * hypot(fy, cy)
        or fy * y - (height - cy) * z > radius * hypot(fy, height - cy)
    )


@compiled
def draw(
    order: Indices,
    first: Indices,
    corners: Array,
    normals: Array,
    faces: Array,
    places: Array,
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
    image: Image,
    nearness: Array,
    shown: Indices,
) -> None:
    """Draw bodies one after the other; the arrays are those of `ExactRenderer`."""
    height, width = nearness.shape
    corner = np.empty((3, CORNER))
    part = np.empty((4, CORNER))
    fan = np.empty((3, CORNER))
    spots = np.empty((3, 3))
    even = np.empty((6, 3))
    normal = np.empty(3)
    eye = np.empty(3)
    # Under lamps that are far away, and do not shine, the corners of a flat face have one colour.
    is_even = not (lights[:, NEAR].any() or lights[:, SPECULAR : SPECULAR + 3].any())
    for body in order:
        R = rotations[body]
        middle = middles[body]
        if radii[body] > 0.0 and is_outside(middle, radii[body], view, height, width):
            continue
        for k in range(3):
            eye[k] = -(R[0, k] * middle[0] + R[1, k] * middle[1] + R[2, k] * middle[2])
        for face in range(first[body], first[body + 1]):
            plane = faces[face]
            if plane[0] * eye[0] + plane[1] * eye[1] + plane[2] * eye[2] <= plane[3]:
                continue
            inside = 0
            for k in range(3):
                at = corners[3 * face + k]
                for i in range(3):
                    corner[k, i] = R[i, 0] * at[0] + R[i, 1] * at[1] + R[i, 2] * at[2] + middle[i]
                inside += corner[k, 2] > near
            if inside == 0:
                continue
            if inside == 3 and not project(corner, view, spots, height, width):
                continue
            for k in range(3):
                at = normals[3 * face + k]
                for i in range(3):
                    normal[i] = R[i, 0] * at[0] + R[i, 1] * at[1] + R[i, 2] * at[2]
                if k > 0 and is_even and plane[4] > 0.0:
                    corner[k, COLOUR:TEXTURE] = corner[0, COLOUR:TEXTURE]
                else:
                    lit(corner[k], normal, rgba[body], shine[body], lights, corner[k, COLOUR:])
                corner[k, TEXTURE] = places[3 * face + k, 0]
                corner[k, TEXTURE + 1] = places[3 * face + k, 1]
            count = 3 if inside == 3 else cut(corner, near, part)
            for k in range(1, count - 1):
                piece = corner
                if inside < 3:
                    fan[0] = part[0]
                    fan[1] = part[k]
                    fan[2] = part[k + 1]
                    piece = fan
                    if not project(fan, view, spots, height, width):
                        continue
                texture = textures[body]
                alpha = rgba[body, 3]
                if texture < 0 or alpha < 1.0:
                    paint(piece, spots, even, body, alpha, image, nearness, shown)
                else:
                    paper(piece, spots, even, body, texels, levels[texture], image, nearness, shown)


@compiled
def fill_sky(
    texels: Indices,
    side: int,
    start: int,
    rotation: Array,
    view: Array,
    image: Image,
    shown: Indices,
) -> None:
    """Fill pixels that show no body from the six pictures of a cube that is far away.

    Args:
        texels: As for `paper`, of the cube's pictures, one under the other without borders.
        side: Of each picture [px].
        start: Place of the first pixel in `texels`.
        rotation: Of the camera in the world (3, 3).
        view: Focal lengths and principal point (4,) [px].
        image: The picture (H, W, 3).
        shown: Numbers of the bodies (H, W); below 0 where there is none.
    """
    height, width = shown.shape
    for v in range(height):
        for u in range(width):
            if shown[v, u] >= 0:
                continue
            a = (u + 0.5 - view[2]) / view[0]
            b = (v + 0.5 - view[3]) / view[1]
            x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2]
            y = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2]
            z = -(rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2])
            # Faces and their axes in the order of OpenGL: right, left, up, down, front, back.
            if abs(x) >= abs(y) and abs(x) >= abs(z):
                face, far, s, t = (0, x, -z, -y) if x > 0 else (1, -x, z, -y)
            elif abs(y) >= abs(z):
                face, far, s, t = (2, y, x, z) if y > 0 else (3, -y, x, -z)
            else:
                face, far, s, t = (4, z, x, -y) if z > 0 else (5, -z, -x, -y)
            across = min(max((s / far + 1) / 2 * side - 0.5, 0.0), side - 1.0)
            down = min(max((t / far + 1) / 2 * side - 0.5, 0.0), side - 1.0)
            column = min(int(across), side - 2)
            row = min(int(down), side - 2)
            p = int(64 * (across - column))
            q = int(64 * (down - row))
            upper = start + (face * side + row) * side + column
            mixed = (
                texels[upper] * ((64 - p) * (64 - q))
                + texels[upper + 1] * (p * (64 - q))
                + texels[upper + side] * ((64 - p) * q)
                + texels[upper + side + 1] * (p * q)
            )
            image[v, u, 0] = ((mixed & 0x1FFFFF) + 2048) >> 12
            image[v, u, 1] = (((mixed >> 21) & 0x1FFFFF) + 2048) >> 12
            image[v, u, 2] = ((mixed >> 42) + 2048) >> 12
