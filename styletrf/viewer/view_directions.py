"""How the directions differ that views see along.

    t(d) = A (d - m),   A = diag(1 / s_1, 1 / s_2, 1 / s_3) V^T

with the mean m of the directions, and the root mean square s_i of their differences from it along
the principal axis i, a column of V. So t is about 1 along each axis, whether views look the same
way or from all around.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import pixel_centers
from styletrf.viewer.visibility import CPU, Views, of_pixels

_RAYS_OF_CAMERA = 1000.0
_LEAST_SPREAD = 1e-2
"""Of an axis, of the greatest; and of a unit direction."""


@dataclass(frozen=True, slots=True)
class ViewDirections:
    """What directions are turned by: see above.

    Attributes:
        mean: m.
        axes: A.
    """

    mean: Float[np.ndarray, " 3"]
    axes: Float[np.ndarray, "3 3"]

    def turned(self, directions: Float[np.ndarray, "rays 3"]) -> Float[np.ndarray, "rays 3"]:
        """Returns how unit directions differ from the mean."""
        turned: Float[np.ndarray, "rays 3"] = (directions - self.mean) @ self.axes.T
        return turned.astype(np.float32)


def view_directions(views: Views, step_length: float) -> ViewDirections:
    """Returns how the directions of all cameras' rays differ.

    Args:
        views: That see a field.
        step_length: Of the field's march.
    """
    rays = ViewRays(views.cameras, views.space, step_length, CPU)
    parts = []
    for k, camera in enumerate(views.cameras):
        small = of_pixels(camera, _RAYS_OF_CAMERA)
        pixels = pixel_centers(small.width, small.height)
        pixels *= np.array([camera.width / small.width, camera.height / small.height])
        parts.append(rays.segments(k, torch.from_numpy(pixels)).view_directions.numpy())
    directions = np.concatenate(parts).astype(np.float64)
    mean = directions.mean(axis=0)
    squares, principal = np.linalg.eigh(np.cov(directions.T, bias=True))
    spread = np.sqrt(squares.clip(0))
    least = _LEAST_SPREAD * max(_LEAST_SPREAD, spread.max())
    axes = principal.T / np.maximum(spread, least)[:, None]
    return ViewDirections(mean.astype(np.float32), axes.astype(np.float32))
