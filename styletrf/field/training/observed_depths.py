"""Losses by which the rays of a fit end at the depths that photographs show.

Few photographs can each be explained by fog right before the camera, and only depths that several
of them agree on speak against it (DS-NeRF, Deng et al. 2022). With w_i the weights of the samples
along such a ray, near those whose depth is within a window of the pixel's, and before those that
are nearer to the camera, the loss of a ray is one of two:

    sparse:  (1 - sum_{near} w_i) + sum_{before} w_i
    dense:   -log((sum_{near} w_i + UNEXPLAINED) / (1 + UNEXPLAINED))

Sixteen photographs or more have depths of sparse points, with the terms of the line of sight
(Rematas et al. 2022, Urban Radiance Fields, section 3.3), a box in place of a normal distribution.
In NDC they have none: density that is spread along rays fits them better (decision 19).

Fewer photographs have depths of stereo as well (`styletrf.scene.stereo`), for most textured pixels.
There the sparse loss would empty all rays before density has gathered at the depths. The dense loss
is the negative log-likelihood that a ray ends at its depth. Its gradient grows where little is
near, and so moves matter to the depth (decision 54). Both losses are bounded, by 2 and 3.1, so that
a wrong depth cannot undo what many photographs show.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels import RaySegments, Samples
from styletrf.geometry.cameras import Camera, in_view, pixel_centers
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import SceneModel
from styletrf.scene.stereo.stereo_depths import Image, Mask, StereoDepth, stereo_depths

SPARSE_WINDOW, DENSE_WINDOW = 0.1, 0.05  # of a pixel's depth, on either side
UNEXPLAINED = 0.05  # fraction of the rays that may end anywhere
MANY = 16  # photographs, or views of panoramas: to count their places instead lost 1.4 dB


@dataclass(frozen=True, slots=True)
class ObservedDepths:
    """Pixels of views with the depth Z of their surfaces; dense with those of stereo."""

    view: Int64[Tensor, " observations"]
    pixel: Float[Tensor, "observations 2"]
    depth: Float[Tensor, " observations"]
    are_dense: bool

    def __len__(self) -> int:
        return len(self.view)

    def drawn(self, count: int, generator: torch.Generator) -> "ObservedDepths":
        """Returns `count` observations, drawn with replacement."""
        index = torch.randint(len(self), (count,), generator=generator).to(self.view.device)
        return replace(
            self, view=self.view[index], pixel=self.pixel[index], depth=self.depth[index]
        )

    def to(self, device: torch.device) -> "ObservedDepths":
        """Returns the observations on a device."""
        view, pixel, depth = (part.to(device) for part in (self.view, self.pixel, self.depth))
        return replace(self, view=view, pixel=pixel, depth=depth)


def observed_depths(
    model: SceneModel,
    cameras: Sequence[Camera],
    points: SparsePoints,
    images: Iterable[Image],
    masks: Iterable[Mask | None],
) -> ObservedDepths:
    """Returns the depths of points, and of few photographs those of stereo, at the working size.

    Args:
        model: The model of the scene, in whose normalized world the depths are.
        cameras: The cameras in the world, in the order in which `points` counts images.
        points: The points with their tracks.
        images: The images of the cameras, RGB in [0, 1], at any size.
        masks: Which pixels count, at the images' size; None where all of an image do.
    """
    normalized, are_few = model.normalized(cameras), len(cameras) < MANY
    parts = [(np.zeros((0, 2)), np.zeros(0))]
    if are_few or model.space.kind != "ndc":
        parts = list(_of_points(model, normalized, points))
    if are_few:
        parts += map(_of_map, normalized, stereo_depths(model, cameras, points, images, masks))
    views = [np.full(len(depth), k % len(cameras)) for k, (_, depth) in enumerate(parts)]
    return ObservedDepths(
        torch.from_numpy(np.concatenate(views)).long(),
        torch.from_numpy(np.concatenate([pixel for pixel, _ in parts])).double(),
        torch.from_numpy(np.concatenate([depth for _, depth in parts])).float(),
        are_few,
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
    samples: Samples, segments: RaySegments, depths: ObservedDepths
) -> Float[Tensor, ""]:
    """Returns the mean loss of rays with depths, differentiable in the samples' weights.

    Args:
        samples: The samples along the rays.
        segments: The rays.
        depths: Where each ray ends, in the order of the rays.
    """
    reached = segments.depth_along(samples.ray, samples.s) / depths.depth[samples.ray]
    if not depths.are_dense:
        near, before = (reached - 1).abs() <= SPARSE_WINDOW, reached < 1 - SPARSE_WINDOW
        value = samples.weights * (before.float() - near.float())
        return 1 + value.sum() / max(len(segments), 1)
    near_weights = samples.weights * ((reached - 1).abs() <= DENSE_WINDOW)
    near_sums = near_weights.new_zeros(len(segments)).index_add(0, samples.ray, near_weights)
    return -((near_sums + UNEXPLAINED) / (1 + UNEXPLAINED)).log().mean()
