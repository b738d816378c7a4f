"""The directions in which views see, and how all colors change with them.

    t(d) = A (d - m),   A = diag(1 / s_1, 1 / s_2, 1 / s_3) V^T
    tint(d) = sum_k c_k q_k(clip(t(d), least, most)),   q_k: the 19 monomials of degrees 1 to 3

with the mean m of the directions, and the root mean square s_i of their differences from it along
the principal axis i, a column of V. So t is about 1 along each axis, whether views look the same
way or from all around. Each t_i is clipped to those of the views: a polynomial grows beyond them.

Directions have length 1, so they lie on a surface, on which the 19 monomials span 16 functions with
the constant. Several coefficients give the same tint; the damping of the fit takes small ones.
"""

import itertools
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import pixel_centers
from styletrf.viewer.visibility import CPU, Views, of_pixels

_RAYS_OF_CAMERA = 1000.0
_LEAST_SPREAD = 1e-2
"""The least spread of an axis, as a fraction of the greatest; and of a unit direction."""
MONOMIALS = sorted(
    axes
    for degree in (1, 2, 3)
    for axes in itertools.combinations_with_replacement(range(3), degree)
)
"""The axes whose coordinates each monomial multiplies, in the order of the shader's loops."""


@dataclass(frozen=True, slots=True)
class ViewDirections:
    """The axes of view directions, and their effect on all colors: see above.

    Attributes:
        mean: m.
        axes: A.
        least: The least t of the views, along each axis.
        most: The greatest.
        tint: c_k, of red, green and blue before their sigmoid.
    """

    mean: Float[np.ndarray, " 3"]
    axes: Float[np.ndarray, "3 3"]
    least: Float[np.ndarray, " 3"]
    most: Float[np.ndarray, " 3"]
    tint: Float[np.ndarray, "monomials 3"]

    def turned(self, directions: Float[np.ndarray, "rays 3"]) -> Float[np.ndarray, "rays 3"]:
        """Returns how unit directions differ from the mean."""
        turned: Float[np.ndarray, "rays 3"] = (directions - self.mean) @ self.axes.T
        return turned.astype(np.float32)

    def tints(self, turned: Float[np.ndarray, "rays 3"]) -> Float[np.ndarray, "rays 3"]:
        """Returns the term added to all colors along turned directions, before their sigmoid."""
        inside = turned.clip(self.least, self.most)
        monomials = np.stack(
            [inside[:, axes].prod(axis=1) for axes in map(list, MONOMIALS)], axis=1
        )
        tints: Float[np.ndarray, "rays 3"] = monomials @ self.tint
        return tints.astype(np.float32)


def view_directions(views: Views, step_length: float) -> ViewDirections:
    """Returns how the directions of all cameras' rays differ, with no tint.

    Args:
        views: The views that see a field.
        step_length: The step length of the field's march.
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
    turned = (directions - mean) @ axes.T
    of_views = (mean, axes, turned.min(axis=0), turned.max(axis=0), np.zeros((len(MONOMIALS), 3)))
    return ViewDirections(*(part.astype(np.float32) for part in of_views))
