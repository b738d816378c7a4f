"""Depths of sparse points in a fit: a ray through a point ends where the point is.

With w_i the weights of the samples along such a ray, the loss of a ray is

    (1 - sum_{near} w_i) + sum_{before} w_i,

near being the samples whose depth is within DEPTH_WINDOW of the point's, as a share of it, and
before those that are nearer to the camera. The terms are those of the line of sight (Rematas et
al. 2022, Urban Radiance Fields, section 3.3) with a box in place of a normal distribution; their
use is that of DS-NeRF (Deng et al. 2022): few photographs can each be explained by fog right before
the camera, and only points that several of them show speak against it. The loss of a ray is at
most 2, so that a wrong point cannot undo what many photographs show.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels import Samples, Segments
from styletrf.geometry.cameras import Camera, in_view
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import SceneModel

DEPTH_WINDOW = 0.1  # of a point's depth, on either side


@dataclass(frozen=True, slots=True)
class SparseDepths:
    """Observations of sparse points: a pixel of a view, and the point's depth Z in that view."""

    view: Int64[Tensor, " observations"]
    pixel: Float[Tensor, "observations 2"]
    depth: Float[Tensor, " observations"]

    def __len__(self) -> int:
        return len(self.view)

    def drawn(self, count: int, generator: torch.Generator) -> "SparseDepths":
        """Returns so many observations, drawn with replacement."""
        index = torch.randint(len(self), (count,), generator=generator).to(self.view.device)
        return SparseDepths(self.view[index], self.pixel[index], self.depth[index])

    def to(self, device: torch.device) -> "SparseDepths":
        """Returns the observations on a device."""
        return SparseDepths(self.view.to(device), self.pixel.to(device), self.depth.to(device))


def sparse_depths(
    model: SceneModel, cameras: Sequence[Camera], points: SparsePoints
) -> SparseDepths:
    """Returns what the cameras observe, at the working size and in the normalized world.

    In NDC nothing: there no camera stands in the grid, and matter that is spread along rays
    interpolates views better than matter at the points does (decision 19).

    Args:
        model: Of the scene.
        cameras: Of the world, in the order in which `points` counts images.
        points: With their tracks.
    """
    points_normalized = transformed(model.normalized_from_world, points.xyz_world)
    views, pixels, depths = [np.zeros(0, np.int64)], [np.zeros((0, 2))], [np.zeros(0)]
    for k, camera in enumerate(model.normalized(cameras) if model.space.kind != "ndc" else ()):
        observed = points_normalized[points.observed_point[points.observed_image == k]]
        pixel, depth, inside = in_view(camera, observed)
        views.append(np.full(int(inside.sum()), k))
        pixels.append(pixel[inside])
        depths.append(depth[inside])
    return SparseDepths(
        torch.from_numpy(np.concatenate(views)).long(),
        torch.from_numpy(np.concatenate(pixels)).double(),
        torch.from_numpy(np.concatenate(depths)).float(),
    )


def depth_loss(
    samples: Samples, segments: Segments, depth: Float[Tensor, " rays"]
) -> Float[Tensor, ""]:
    """Returns the mean loss of rays through points, differentiable in the samples' weights.

    Args:
        samples: Along the rays.
        segments: The rays.
        depth: Of each ray's point, along the camera's axis; above 0.
    """
    reached = segments.depth_along(samples.ray, samples.s) / depth[samples.ray]
    near = (reached - 1).abs() <= DEPTH_WINDOW
    before = reached < 1 - DEPTH_WINDOW
    value = samples.weights * (before.float() - near.float())
    return 1 + value.sum() / max(len(segments), 1)
