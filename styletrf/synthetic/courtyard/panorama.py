"""Equirectangular panoramas of the courtyard: all directions around a place, with exact color."""

from typing import no_type_check

import numpy as np
from jaxtyping import Float, UInt8

from styletrf.synthetic.courtyard.capture import CourtyardConfig, lit_scene
from styletrf.synthetic.courtyard.rays import in_threads, kernel, new_stack
from styletrf.synthetic.courtyard.render import BRIGHTEST, RAYS, developed
from styletrf.synthetic.courtyard.shading import seen_color

_STRIPS = 16


def render_panorama(
    world_from_panorama: Float[np.ndarray, "3 4"], width: int, config: CourtyardConfig
) -> UInt8[np.ndarray, "height width 3"]:
    """Returns the view all around, `width` pixels wide and half as high (sRGB).

    The panorama's axes are x right, y down, z ahead; z is in the middle, see
    `styletrf.capture.panorama.panorama_views`. Of the configuration, seed, gloss and kind matter.
    """
    scene = lit_scene(config)
    edges = np.linspace(0, width // 2, _STRIPS + 1).astype(int)
    light = np.zeros((width // 2, width, 3))

    def trace(strip: int) -> None:
        first, last = edges[strip : strip + 2]
        _trace(scene, world_from_panorama, RAYS, light, first, last)

    list(in_threads(trace, range(_STRIPS)))
    return developed(light)


@no_type_check
@kernel
def _trace(scene, world_from_panorama, offsets, light, first, last):
    stack = new_stack()
    height, width = light.shape[:2]
    R = world_from_panorama[:, :3]
    ox, oy, oz = world_from_panorama[:, 3]
    for row in range(first, last):
        for column in range(width):
            for i in range(len(offsets)):
                longitude = ((column + offsets[i, 0]) / width - 0.5) * 2 * np.pi
                below = ((row + offsets[i, 1]) / height - 0.5) * np.pi
                x = np.sin(longitude) * np.cos(below)
                y = np.sin(below)
                z = np.cos(longitude) * np.cos(below)
                dx = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z
                dy = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
                dz = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z
                r, g, b, _ = seen_color(scene, stack, ox, oy, oz, dx, dy, dz)
                light[row, column, 0] += min(r, BRIGHTEST) / len(offsets)
                light[row, column, 1] += min(g, BRIGHTEST) / len(offsets)
                light[row, column, 2] += min(b, BRIGHTEST) / len(offsets)
