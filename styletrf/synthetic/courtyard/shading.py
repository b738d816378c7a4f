"""The color of a ray: of the sky, or of a surface, with the reflection of a glossy one.

Colors are linear light. A surface's color is `texture(uv) * light`, both fixed before any view is
taken, so it is the same from everywhere (Lambert). Only a glossy surface adds a mirror image,
weighted by Schlick's approximation of Fresnel's law.
"""

from typing import Any, NamedTuple, no_type_check

import numpy as np

from styletrf.synthetic.courtyard.rays import Hierarchy, first_hit, kernel

SUN = np.array([-0.50, -0.47, 0.73]) / np.linalg.norm([-0.50, -0.47, 0.73])
_SUN_X, _SUN_Y, _SUN_Z = (float(x) for x in SUN)
_MIRRORED_AT_NORMAL = 0.14
_GLINT = 18.0
_GLINT_POWER = 120.0
_OFF_SURFACE = 1e-4  # meters


@no_type_check
class Surfaces(NamedTuple):
    """All that a ray can meet, as arrays for the kernels."""

    tree: Hierarchy
    corners: Any  # triangles x (three corners of u, v, red, green, blue of light, normal)
    textures: Any  # triangles x (first texel, height, width, whether it is glossy)
    texels: Any  # all textures one after the other x 3, float32


@no_type_check
@kernel
def sky(dz):
    """Returns the plain sky at a height (sine of elevation): pale at the horizon, blue above."""
    up = min(max(dz, 0.0), 1.0) ** 0.7
    return 0.80 - 0.68 * up, 0.98 - 0.58 * up, 1.25 - 0.35 * up


@no_type_check
@kernel
def _between(corners, triangle, u, v, channel):
    """Returns one channel of the corners' values, interpolated inside a triangle."""
    return (
        (1.0 - u - v) * corners[triangle, 0, channel]
        + u * corners[triangle, 1, channel]
        + v * corners[triangle, 2, channel]
    )


@no_type_check
@kernel
def surface_color(scene, triangle, u, v):
    """Returns texture times light at a point of a triangle (bilinear between texel centers)."""
    corners, t = scene.corners, scene.texels
    start, height, width, _ = scene.textures[triangle]
    x = _between(corners, triangle, u, v, 0) * width - 0.5
    y = _between(corners, triangle, u, v, 1) * height - 0.5
    x, y = min(max(x, 0.0), width - 1.001), min(max(y, 0.0), height - 1.001)
    x0, y0 = int(x), int(y)
    fx, fy = x - x0, y - y0
    i = start + y0 * width + x0
    j = i + width
    w00, w01, w10, w11 = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
    red = w00 * t[i, 0] + w01 * t[i + 1, 0] + w10 * t[j, 0] + w11 * t[j + 1, 0]
    green = w00 * t[i, 1] + w01 * t[i + 1, 1] + w10 * t[j, 1] + w11 * t[j + 1, 1]
    blue = w00 * t[i, 2] + w01 * t[i + 1, 2] + w10 * t[j, 2] + w11 * t[j + 1, 2]
    return (
        red * _between(corners, triangle, u, v, 2),
        green * _between(corners, triangle, u, v, 3),
        blue * _between(corners, triangle, u, v, 4),
    )


@no_type_check
@kernel
def _with_mirror(scene, stack, color, triangle, u, v, point, direction):
    """Returns the color of a glossy point seen along a unit direction."""
    nx = _between(scene.corners, triangle, u, v, 5)
    ny = _between(scene.corners, triangle, u, v, 6)
    nz = _between(scene.corners, triangle, u, v, 7)
    scale = 1.0 / np.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx * scale, ny * scale, nz * scale
    dx, dy, dz = direction
    facing = min(dx * nx + dy * ny + dz * nz, 0.0)
    mx, my, mz = dx - 2 * facing * nx, dy - 2 * facing * ny, dz - 2 * facing * nz
    mirrored = _MIRRORED_AT_NORMAL + (1 - _MIRRORED_AT_NORMAL) * (1 + facing) ** 5
    ox, oy, oz = point
    ox, oy, oz = ox + _OFF_SURFACE * nx, oy + _OFF_SURFACE * ny, oz + _OFF_SURFACE * nz
    _, other, u, v = first_hit(scene.tree, stack, ox, oy, oz, mx, my, mz, any_hit=False)
    if other >= 0:
        red, green, blue = surface_color(scene, other, u, v)
    else:
        red, green, blue = sky(mz)
        toward_sun = max(mx * _SUN_X + my * _SUN_Y + mz * _SUN_Z, 0.0)
        glint = _GLINT * toward_sun**_GLINT_POWER
        red, green, blue = red + glint, green + 0.9 * glint, blue + 0.75 * glint
    r, g, b = color
    return r + mirrored * (red - r), g + mirrored * (green - g), b + mirrored * (blue - b)


@no_type_check
@kernel
def seen_color(scene, stack, ox, oy, oz, dx, dy, dz):
    """Returns (red, green, blue, ray parameter) along a ray, the last infinite in the sky."""
    t, triangle, u, v = first_hit(scene.tree, stack, ox, oy, oz, dx, dy, dz, any_hit=False)
    scale = 1.0 / np.sqrt(dx * dx + dy * dy + dz * dz)
    if triangle < 0:
        red, green, blue = sky(dz * scale)
        return red, green, blue, t
    color = surface_color(scene, triangle, u, v)
    if scene.textures[triangle, 3]:
        point = (ox + t * dx, oy + t * dy, oz + t * dz)
        direction = (dx * scale, dy * scale, dz * scale)
        color = _with_mirror(scene, stack, color, triangle, u, v, point, direction)
    red, green, blue = color
    return red, green, blue, t
