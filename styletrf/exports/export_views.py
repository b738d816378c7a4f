"""Chooses the supported views that exports are made from, and the points that their pixels see.

A point lies where the transmittance of a pixel's ray falls to one half.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int64

from styletrf.errors import InputError
from styletrf.even_spread import evenly_spread
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig, Rendering
from styletrf.geometry.cameras import Camera, fitted_to, pixel_centers, points_at_depth
from styletrf.progress import Progress, silent
from styletrf.scene.scene_model import SceneModel
from styletrf.trajectory.frames import rendered

_MOST_PIXELS, _MOST_POINTS = 8_000_000, 4_000_000
_FEWEST_VIEWS, _MOST_VIEWS = 24, 48
_FARTHEST = 100.0  # from the origin, in the normalized unit: single precision rounds to 1e-7 of it

Look = tuple[str, Callable[[], RadianceField]]
"""The name of a look, and the function that loads its field."""


@dataclass(frozen=True, slots=True)
class SurfacePoints:
    """Points that pixels of some views see.

    Attributes:
        positions: The positions in the world of the cameras.
        footprints: The width of a pixel there, in the world's unit.
    """

    positions: Float[np.ndarray, "points 3"]
    footprints: Float[np.ndarray, " points"]

    def __len__(self) -> int:
        return len(self.positions)


@dataclass(frozen=True, slots=True)
class ExportViews:
    """Views of a scene, in its normalized world.

    Attributes:
        model: Of the scene.
        field: With the photographs' appearance.
        cameras: Photographs not held out and places of the fly-through.
        renders: The renders of the field.
        device: The device that renders pictures.
    """

    model: SceneModel
    field: RadianceField
    cameras: Sequence[Camera]
    renders: Sequence[Rendering]
    device: torch.device

    def pictures(self, field: RadianceField, progress: Progress = silent) -> Iterator[np.ndarray]:
        """Yields the cameras' pictures of a field: 3 colors in [0, 1] for each pixel."""
        if field is self.field:
            yield from (render.color.numpy() for render in self.renders)
            return
        space, config = self.model.space, RenderConfig()
        for render in rendered(field, space, self.cameras, config, self.device, progress):
            yield render.color.numpy()

    def points(self) -> SurfacePoints:
        """Returns the surface points of all views, in the normalized world.

        Raises:
            InputError: There is no such point.
        """
        points = surface_points(self.cameras, self.renders)
        if not len(points):
            problem = "stops no ray of any view: there is nothing to export"
            raise InputError("the field", problem, "Look at its frames, and fit it again")
        return points

    def to_grid(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
        """Returns points of the normalized world in coordinates of the field's grid."""
        return self.model.space.within(self.field.bounds).to_grid(points)


def export_views(
    model: SceneModel,
    field: RadianceField,
    photographed: Sequence[Camera],
    path: Sequence[Camera],
    device: torch.device,
    progress: Progress = silent,
) -> ExportViews:
    """Returns views spread over the photographs and the fly-through, as many as memory allows.

    There are at least 24, smaller than the photographs if these are large.

    Args:
        model: Of the scene.
        field: With the photographs' appearance.
        photographed: The cameras of photographs that are not held out, in the normalized world.
        path: The fly-through, in the normalized world.
        device: The device that renders pictures.
        progress: Called after every picture.
    """
    side = max(photographed[0].width, photographed[0].height)
    every = [*photographed, *(fitted_to(camera, side) for camera in path)]
    pixels = float(np.mean([camera.width * camera.height for camera in every]))
    count = int(np.clip(_MOST_PIXELS / pixels, _FEWEST_VIEWS, _MOST_VIEWS))
    side = int(side * min(1.0, (_MOST_PIXELS / (count * pixels)) ** 0.5))
    cameras = [fitted_to(camera, side) for camera in evenly_spread(every, count)]
    renders = list(rendered(field, model.space, cameras, RenderConfig(), device, progress))
    return ExportViews(model, field, cameras, renders, device)


def offset_world(model: SceneModel) -> Float[np.ndarray, " 3"]:
    """Returns the point of the world that is the origin of files in single precision.

    It is the world's own origin, or that of the normalized world where this is far away, as in
    georeferenced poses.
    """
    world_from_normalized = np.linalg.inv(model.normalized_from_world)
    origin: Float[np.ndarray, " 3"] = world_from_normalized[:3, 3]
    unit = np.cbrt(np.linalg.det(world_from_normalized[:3, :3]))
    return origin if np.linalg.norm(origin) > _FARTHEST * unit else np.zeros(3)


def stored_from_normalized(model: SceneModel) -> Float[np.ndarray, "4 4"]:
    """Returns the similarity from the normalized world to the world less its offset."""
    stored: Float[np.ndarray, "4 4"] = np.linalg.inv(model.normalized_from_world)
    stored[:3, 3] -= offset_world(model)
    return stored


def surface_points(cameras: Sequence[Camera], renders: Sequence[Rendering]) -> SurfacePoints:
    """Returns the points of pixels whose ray meets something: of all, or of some four million."""
    positions, footprints = [], []
    views = zip(cameras, renders, _pixels_with_points(renders), strict=True)
    for camera, render, seen in views:
        depth = render.median_depth.numpy().ravel()[seen].astype(np.float64)
        pixels = pixel_centers(camera.width, camera.height)[seen]
        positions.append(points_at_depth(camera, pixels, depth))
        footprints.append(depth / camera.fx)
    return SurfacePoints(np.concatenate(positions), np.concatenate(footprints))


def point_colors(
    renders: Sequence[Rendering], pictures: Iterable[Float[np.ndarray, "_ _ 3"]]
) -> Float[np.ndarray, "points 3"]:
    """Returns the colors of the pixels whose points `surface_points` returns, in that order."""
    pairs = zip(_pixels_with_points(renders), pictures, strict=True)
    return np.concatenate([picture.reshape(-1, 3)[seen] for seen, picture in pairs])


def _pixels_with_points(renders: Sequence[Rendering]) -> Iterator[Int64[np.ndarray, " seen"]]:
    """Yields the pixels of each view that get points, evenly spread where these are too many."""
    stride = -(-sum(render.median_depth.numel() for render in renders) // _MOST_POINTS)
    for render in renders:
        yield np.flatnonzero(np.isfinite(render.median_depth.numpy().ravel()))[::stride]
