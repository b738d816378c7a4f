"""Depths that photographs show, in a fit: the ray of a pixel ends at its depth.

With w_i the weights of the samples along such a ray, the loss of a ray is

    -log((sum_{near} w_i + UNEXPLAINED) / (1 + UNEXPLAINED)),

near being the samples whose depth is within DEPTH_WINDOW of the pixel's, as a share of it. It is
the likelihood that the ray ends there (DS-NeRF, Deng et al. 2022, eq. 4, with a box in place of a
normal distribution): few photographs can each be explained by fog right before the camera, and only
depths that several of them agree on speak against it. Its gradient grows where little is near, and
so moves matter to the depth; a loss linear in w_i only removes what lies before (decision 54). A
share UNEXPLAINED of the rays may end anywhere: a loss is at most 3.1, so that a wrong depth cannot
undo what many photographs show.

Depths come from sparse points, and of few photographs from stereo (`styletrf.scene.stereo`) for
most textured pixels, too. Many photographs say where matter is by their colors, better than stereo
does. In NDC they have no depths at all: matter that is spread along rays fits them better.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels import Samples, Segments
from styletrf.geometry.cameras import Camera, in_view, pixel_centers
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import SceneModel
from styletrf.scene.stereo.stereo_depths import Image, Mask, StereoDepth, stereo_depths

DEPTH_WINDOW = 0.05  # of a pixel's depth, on either side
UNEXPLAINED = 0.05
MANY = 16  # photographs


@dataclass(frozen=True, slots=True)
class ObservedDepths:
    """Pixels of views, and the depth Z of what they show."""

    view: Int64[Tensor, " observations"]
    pixel: Float[Tensor, "observations 2"]
    depth: Float[Tensor, " observations"]

    def __len__(self) -> int:
        return len(self.view)

    def drawn(self, count: int, generator: torch.Generator) -> "ObservedDepths":
        """Returns so many observations, drawn with replacement."""
        index = torch.randint(len(self), (count,), generator=generator).to(self.view.device)
        return ObservedDepths(self.view[index], self.pixel[index], self.depth[index])

    def to(self, device: torch.device) -> "ObservedDepths":
        """Returns the observations on a device."""
        return ObservedDepths(self.view.to(device), self.pixel.to(device), self.depth.to(device))


def observed_depths(
    model: SceneModel,
    cameras: Sequence[Camera],
    points: SparsePoints,
    images: Iterable[Image],
    masks: Iterable[Mask | None],
) -> ObservedDepths:
    """Returns the depths of points, and those of stereo of few photographs, at the working size.

    Args:
        model: Of the scene, in whose normalized world the depths are.
        cameras: Of the world, in the order in which `points` counts images.
        points: With their tracks.
        images: Of the cameras, RGB in [0, 1], at any size.
        masks: Which pixels count, at the images' size; None where all of an image do.
    """
    normalized, are_many = model.normalized(cameras), len(cameras) >= MANY
    parts = [(np.zeros((0, 2)), np.zeros(0))]
    if not (are_many and model.space.kind == "ndc"):
        parts = list(_of_points(model, normalized, points))
    if not are_many:
        parts += map(_of_map, normalized, stereo_depths(model, cameras, points, images, masks))
    views = [np.full(len(depth), k % len(cameras)) for k, (_, depth) in enumerate(parts)]
    return ObservedDepths(
        torch.from_numpy(np.concatenate(views)).long(),
        torch.from_numpy(np.concatenate([pixel for pixel, _ in parts])).double(),
        torch.from_numpy(np.concatenate([depth for _, depth in parts])).float(),
    )


def _of_points(
    model: SceneModel, cameras: Sequence[Camera], points: SparsePoints
) -> Iterator[tuple[Float[np.ndarray, "observed 2"], Float[np.ndarray, " observed"]]]:
    """Yields pixels and depths of the points that each camera of the normalized world observes."""
    points_normalized = transformed(model.normalized_from_world, points.xyz_world)
    for k, camera in enumerate(cameras):
        observed = points_normalized[points.observed_point[points.observed_image == k]]
        pixel, depth, inside = in_view(camera, observed)
        yield pixel[inside], depth[inside]


def _of_map(
    camera: Camera, found: StereoDepth
) -> tuple[Float[np.ndarray, "known 2"], Float[np.ndarray, " known"]]:
    """Returns the known depths of a map, and the pixels of a larger camera that have them."""
    known, small = np.isfinite(found.depth), found.camera
    scale = (camera.width / small.width, camera.height / small.height)
    pixels = pixel_centers(small.width, small.height)[known.ravel()] * scale
    return pixels, found.depth[known].astype(np.float64)


def depth_loss(
    samples: Samples, segments: Segments, depth: Float[Tensor, " rays"]
) -> Float[Tensor, ""]:
    """Returns the mean loss of rays with a depth, differentiable in the samples' weights.

    Args:
        samples: Along the rays.
        segments: The rays.
        depth: Where each ray ends, along the camera's axis; above 0.
    """
    reached = segments.depth_along(samples.ray, samples.s) / depth[samples.ray]
    is_near = (reached - 1).abs() <= DEPTH_WINDOW
    near = samples.weights.new_zeros(len(segments))
    near = near.index_add(0, samples.ray, samples.weights * is_near)
    return -((near + UNEXPLAINED) / (1 + UNEXPLAINED)).log().mean()
