"""Chooses the priors: a few viewpoints that together show all that the trajectory sees."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float

from styletrf.even_spread import evenly_spread
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.files.float_images import read_float_image
from styletrf.files.frame_limits import DEFAULT_RATE, require_frame_limits
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera, resized
from styletrf.geometry.space import Space
from styletrf.trajectory.coverage import (
    CoverageConfig,
    Depth,
    covering,
    covering_once,
    places_seen,
    shown,
    small_camera,
)
from styletrf.trajectory.frames import rendered
from styletrf.trajectory.trajectory_config import TrajectoryConfig

_PLACES = 20_000  # of those that the trajectory sees


@dataclass(frozen=True, slots=True)
class PriorsConfig:
    """Candidates (`trajectory`), how many of them are needed, and how they are rendered.

    Viewpoints are `spread` over the volume that the fly-through encloses, or lie on its own `path`,
    as the publication's lie on a spiral. A `long_side_px` of 0 is the scene's working size.
    """

    long_side_px: int = 0
    viewpoints: Literal["spread", "path"] = "spread"
    trajectory: TrajectoryConfig = field(default_factory=lambda: TrajectoryConfig(frames=40))
    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    frames_per_second: int = DEFAULT_RATE

    def __post_init__(self) -> None:
        require_frame_limits(self.long_side_px, self.frames_per_second)
        if self.coverage.count > self.trajectory.frames:
            asked = f"{self.coverage.count} of {self.trajectory.frames}"
            raise ValueError(f"{asked} viewpoints cannot be chosen; raise trajectory.frames")


@dataclass(frozen=True, slots=True)
class _View:
    """A candidate, its camera at the size that decides visibility, and the depth there."""

    camera: Camera
    small: Camera
    depth: Depth


def needed_views(
    candidates: Sequence[Camera],
    trajectory: Path,
    radiance: RadianceField,
    space: Space,
    config: PriorsConfig,
    device: torch.device,
) -> list[Camera]:
    """Returns the candidates that cover the places that the renders of a trajectory show.

    Where they show too little of it, as of a path that goes elsewhere than they do, views along the
    trajectory are candidates, too. Then views of both kinds are added until at least one shows
    nearly every place that any shows, such as a strip at the edge of frames.

    Args:
        candidates: Viewpoints in the normalized world; views along the trajectory, where these are
            wanted, have the size of the first.
        trajectory: The folder that `write_float_frames` wrote.
        radiance: The field, whose depth decides what a candidate shows.
        space: The space of the field.
        config: The viewpoints, and how well they have to cover the trajectory.
        device: The device that renders.
    """
    cameras, coverage = read_cameras(trajectory / "cameras.parquet"), config.coverage
    places = _places_along(cameras, trajectory)
    render = partial(_views, radiance, space, coverage, device)
    if config.viewpoints == "path":
        candidates, own = views_along(cameras, candidates[0], config.trajectory.frames), []
    else:
        own = views_along(cameras, candidates[0], len(candidates))
    views = render(candidates)
    if own and _hidden(_seen(views, places, coverage)) > coverage.most_hidden * len(places):
        views, own = [*views, *render(own)], []
    chosen = covering(_seen(views, places, coverage), coverage)
    nearly = _seen([views[k] for k in chosen], places, coverage, reach_px=1)
    if not coverage.count and _hidden(nearly) > (1 - coverage.once) * len(places):
        views += render(own)
        chosen = covering_once(_seen(views, places, coverage, reach_px=1), chosen, coverage)
    return [replace(views[k].camera, name=f"{i:04d}") for i, k in enumerate(chosen)]


def _views(
    radiance: RadianceField,
    space: Space,
    config: CoverageConfig,
    device: torch.device,
    cameras: Sequence[Camera],
) -> list[_View]:
    """Returns the views of cameras, with the depths that are rendered there."""
    small = [small_camera(camera, config) for camera in cameras]
    renders = rendered(radiance, space, small, RenderConfig(), device)
    depths = (render.surface_depth.numpy() for render in renders)
    return [_View(*view) for view in zip(cameras, small, depths, strict=True)]


def _seen(
    views: Sequence[_View],
    places: Float[np.ndarray, "places 3"],
    config: CoverageConfig,
    reach_px: int = 0,
) -> Bool[np.ndarray, "views places"]:
    """Returns which of the places each view shows."""
    return np.stack([
        shown(view.small, view.depth, places, config.tolerance, reach_px) for view in views
    ])  # fmt: skip


def _hidden(seen: Bool[np.ndarray, "views places"]) -> int:
    """Returns how many places no view shows."""
    return int((~seen.any(axis=0)).sum())


def _places_along(cameras: Sequence[Camera], trajectory: Path) -> Float[np.ndarray, "places 3"]:
    """Returns places that the frames show, reading one frame at a time: they may be large."""
    pixels = sum(camera.width * camera.height for camera in cameras)
    files = (trajectory / "frames" / f"{camera.name}.exr" for camera in cameras)
    depths = (read_float_image(file).depth for file in files)
    return places_seen(cameras, depths, max(1.0, math.sqrt(pixels / _PLACES)))


def views_along(path: Sequence[Camera], size: Camera, count: int) -> list[Camera]:
    """Returns at most `count` views, spread evenly along a path, of the size of a camera."""
    return [resized(view, size.width, size.height) for view in evenly_spread(path, count)]
