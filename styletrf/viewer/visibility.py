"""Finds the voxels of a field that the viewer can see: those that any supported view shows.

Most occupied voxels lie behind surfaces; their colors would be most of the page.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float

from styletrf.field.kernels import Samples, kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.field.view_rays import ViewRays
from styletrf.geometry.cameras import Camera, pixel_centers, resized
from styletrf.geometry.space import Space

CPU = torch.device("cpu")
_RAYS = 4_000_000  # of all cameras together, about


@dataclass(frozen=True, slots=True)
class Views:
    """The cameras of a scene, and how pictures of it are rendered.

    Attributes:
        space: The space of the scene.
        cameras: The cameras, in the normalized world.
        render: The settings, of which termination and least weight count.
        radius: How far from a camera the viewer's may be.
    """

    space: Space
    cameras: Sequence[Camera]
    render: RenderConfig
    radius: float = 0.0

    def beside(self) -> list[Camera]:
        """Returns the cameras, and each moved by the radius to a side, above or below."""
        moved = []
        for k, camera in enumerate(self.cameras):
            pose = camera.world_from_camera.copy()
            pose[:, 3] += self.radius * (-1) ** (k // 2) * pose[:, k % 2]
            moved.append(replace(camera, world_from_camera=pose))
        return [*self.cameras, *moved]


@torch.no_grad()
def seen_voxels(field: RadianceField, views: Views, rays: int = _RAYS) -> Bool[np.ndarray, "x y z"]:
    """Returns where a view sees a sample.

    The voxels are half as long as those of the field's occupancy.

    Args:
        field: The field whose density it is.
        views: The views that see it; see `Views.beside`.
        rays: About the number of rays of all views together.
    """
    occupancy = field.density.occupancy.numpy()
    for axis in range(3):
        occupancy = occupancy.repeat(2, axis)
    voxels = np.array(occupancy.shape)
    seen = np.zeros(voxels, dtype=bool)
    cameras = views.beside()
    for camera in cameras:
        samples = heavy_samples(field, views, of_pixels(camera, rays / len(cameras)))[0]
        at = ((samples.positions.numpy() + 1) / 2 * voxels).astype(np.int64)
        seen[tuple(at.clip(0, voxels - 1).T)] = True
    found: Bool[np.ndarray, "x y z"] = seen & (occupancy != 0)
    return found


def of_pixels(camera: Camera, pixels: float) -> Camera:
    """Returns the camera resized so that it has about so many pixels, at least 64; never larger."""
    scale = min(1.0, (max(64.0, pixels) / (camera.width * camera.height)) ** 0.5)
    return resized(camera, *(max(1, round(scale * n)) for n in (camera.width, camera.height)))


def heavy_samples(
    field: RadianceField, views: Views, camera: Camera
) -> tuple[Samples, Float[torch.Tensor, "rays 3"]]:
    """Returns the samples of a camera's rays that get a color, and the rays' directions."""
    kernels = kernels_for(CPU)
    rays = ViewRays([camera], views.space.within(field.bounds), field.step_length, CPU)
    segments = rays.segments(0, torch.from_numpy(pixel_centers(camera.width, camera.height)))
    jitter = torch.full_like(segments.lengths, 0.5)
    march = field.density.march(views.render.termination)
    samples = kernels.trace(field.density.factors, segments, jitter, march)
    return kernels.prune(samples, views.render.min_weight), segments.view_directions
