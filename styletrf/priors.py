"""The priors: of many viewpoints the few that show all that the trajectory sees."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch

from styletrf.camera_table import read_cameras
from styletrf.cameras import Camera
from styletrf.coverage import CoverageConfig, covering, places_seen, shown, small_camera
from styletrf.field import RadianceField
from styletrf.float_images import read_float_image
from styletrf.frames import rendered
from styletrf.rendering import RenderConfig
from styletrf.space import Space
from styletrf.trajectories import TrajectoryConfig

_PLACES = 20_000  # of those that the trajectory sees


@dataclass(frozen=True, slots=True)
class PriorsConfig:
    """Candidates (`trajectory`), how many of them are needed, and how they are rendered.

    A `long_side_px` of 0 is the scene's working size.
    """

    long_side_px: int = 0
    trajectory: TrajectoryConfig = field(default_factory=lambda: TrajectoryConfig(frames=40))
    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    frames_per_second: int = 24

    def __post_init__(self) -> None:
        if self.coverage.count > self.trajectory.frames:
            told = f"{self.coverage.count} of {self.trajectory.frames}"
            raise ValueError(f"{told} viewpoints cannot be chosen; raise trajectory.frames")


def needed_views(
    candidates: Sequence[Camera],
    trajectory: Path,
    radiance: RadianceField,
    space: Space,
    config: CoverageConfig,
    device: torch.device,
) -> list[Camera]:
    """Returns the candidates that cover what the renders of a trajectory show.

    Args:
        candidates: Viewpoints in the normalised world.
        trajectory: What `write_float_frames` wrote.
        radiance: The field, whose depth tells what a candidate shows.
        space: Of the field.
        config: How well they are to cover it.
        device: Where to render.
    """
    cameras = read_cameras(trajectory / "cameras.parquet")
    depths = [read_float_image(trajectory / "frames" / f"{c.name}.exr").depth for c in cameras]
    every = max(1, sum(depth.size for depth in depths) // _PLACES)
    places = places_seen(cameras, depths, every)
    small = [small_camera(camera, config) for camera in candidates]
    seen = [
        shown(camera, render.depth.numpy(), places, config.tolerance)
        for camera, render in zip(
            small, rendered(radiance, space, small, RenderConfig(), device), strict=True
        )
    ]
    chosen = covering(np.stack(seen), config)
    return [replace(candidates[k], name=f"{i:04d}") for i, k in enumerate(chosen)]
