"""Where splats lie in a picture, as 3D Gaussian Splatting projects them (Kerbl et al. 2023).

A splat's image is nearly a Gaussian with the covariance J R Sigma R^T J^T (Zwicker et al. 2001,
EWA splatting), to which 3DGS adds 0.3 square pixels. The pixels are those within 3 deviations.
"""

from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from jaxtyping import Float, Int32

from styletrf.compiled import compiled
from styletrf.exports.splats import Splats
from styletrf.geometry.cameras import Camera, project

BLUR_PX2 = 0.3
LEAST_ALPHA = 1 / 255
MOST_ALPHA = np.float32(0.99)
_NEAREST = 0.01  # of the median depth
_WIDEST = 1.3  # times the view: beyond, the projection's slope is that at the border


@dataclass(frozen=True, slots=True)
class Footprints:
    """What splats contribute to a picture before their opacity; of each pixel nearest first.

    Attributes:
        n_pixels: Of the picture, row by row.
        pixel: Which one.
        splat: Which one.
        share: exp(-d^2 / 2) at the pixel's center, in (0, 1].
    """

    n_pixels: int
    pixel: Int32[np.ndarray, " entries"]
    splat: Int32[np.ndarray, " entries"]
    share: Float[np.ndarray, " entries"]


def footprints(splats: Splats, camera: Camera, termination: float) -> Footprints:
    """Returns the footprints of splats in a camera's picture.

    Args:
        splats: In the camera's world.
        camera: Whose picture it is.
        termination: A pixel takes no further splats once its transmittance is below.
    """
    pixels, depth = project(camera, splats.centers)
    usual = float(np.median(depth[depth > 0])) if (depth > 0).any() else 1.0
    ahead = np.flatnonzero(depth > _NEAREST * usual)
    ahead = ahead[depth[ahead].argsort(kind="stable")]
    conics, radius = _conics(splats.covariances()[ahead], splats.centers[ahead], camera)
    at, opacities = pixels[ahead], splats.opacities[ahead].astype(np.float32)
    pixel, splat, share = _gathered(
        at, conics, radius, opacities, camera.width, camera.height, termination
    )
    return Footprints(camera.width * camera.height, pixel, ahead.astype(np.int32)[splat], share)


def _conics(
    covariances: Float[np.ndarray, "splats 3 3"],
    centers: Float[np.ndarray, "splats 3"],
    camera: Camera,
) -> tuple[Float[np.ndarray, "splats 3"], Float[np.ndarray, " splats"]]:
    """Returns the inverse covariances xx, xy, yy in the picture, and 3 deviations in pixels."""
    rotation = camera.world_from_camera[:, :3]
    x, y, z = ((centers - camera.center_world) @ rotation).T
    wide = _WIDEST * np.array([camera.width / camera.fx, camera.height / camera.fy]) / 2
    x, y = z * np.clip(x / z, -wide[0], wide[0]), z * np.clip(y / z, -wide[1], wide[1])
    zero = np.zeros_like(z)
    jacobian = np.stack([
        np.stack([camera.fx / z, zero, -camera.fx * x / z**2], axis=-1),
        np.stack([zero, camera.fy / z, -camera.fy * y / z**2], axis=-1),
    ], axis=1)  # fmt: skip
    turned = jacobian @ rotation.T
    image = turned @ covariances @ turned.transpose(0, 2, 1)
    xx, xy, yy = image[:, 0, 0] + BLUR_PX2, image[:, 0, 1], image[:, 1, 1] + BLUR_PX2
    determinant = xx * yy - xy * xy
    half = (xx + yy) / 2
    largest = half + np.sqrt(np.maximum(half * half - determinant, 0.0))
    conics = np.stack([yy, -xy, xx], axis=1) / determinant[:, None]
    return conics, 3 * np.sqrt(largest)


def _gathered(
    at: np.ndarray, conics: np.ndarray, radius: np.ndarray, opacities: np.ndarray,
    width: int, height: int, termination: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Returns pixel, splat and share of all entries, counted first and then written."""
    (left, top), (right, bottom) = (at - radius[:, None]).T, (at + radius[:, None]).T
    edges = np.stack([np.floor(left), np.ceil(right), np.floor(top), np.ceil(bottom)], axis=1)
    boxes = np.clip(edges, 0, [width, width, height, height]).astype(np.int32)
    arguments = (at.astype(np.float32), conics.astype(np.float32), boxes, opacities)
    nothing = (np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0, np.float32))
    count = _scan(*arguments, width, width * height, termination, *nothing)
    out = (np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.float32))
    _scan(*arguments, width, width * height, termination, *out)
    return out


@compiled()
@no_type_check
def _scan(at, conics, boxes, opacities, width, n_pixels, termination, pixel, splat, share):
    """Counts the entries of splats that come nearest first; writes them where there is room."""
    left = np.ones(n_pixels, np.float32)
    count = 0
    for k in range(len(at)):
        x0, x1, y0, y1 = boxes[k]
        for row in range(y0, y1):
            dy = row + np.float32(0.5) - at[k, 1]
            for column in range(x0, x1):
                place = row * width + column
                if left[place] < termination:
                    continue
                dx = column + np.float32(0.5) - at[k, 0]
                distance = (
                    conics[k, 0] * dx * dx + 2 * conics[k, 1] * dx * dy + conics[k, 2] * dy * dy
                )
                value = np.exp(np.float32(-0.5) * distance)
                alpha = min(opacities[k] * value, MOST_ALPHA)
                if alpha < LEAST_ALPHA:
                    continue
                left[place] *= 1 - alpha
                if len(pixel):
                    pixel[count], splat[count], share[count] = place, k, value
                count += 1
    return count
