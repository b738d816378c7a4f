"""Camera paths: a spiral before a forward-facing scene, an orbit around an inward-facing one.

All in the normalised world, whose y axis points down. Paths stay within what the photographs saw:
amplitudes are shares of the spread of the given cameras.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from styletrf.cameras import Camera
from styletrf.scene_model import SceneModel


@dataclass(frozen=True, slots=True)
class TrajectoryConfig:
    """A path of `frames` cameras.

    `turns` counts revolutions of a spiral; `spread` is the share of the photographs' own spread
    that the path uses.
    """

    frames: int = 60
    turns: float = 1.0
    spread: float = 0.7


def fly_through(
    cameras: Sequence[Camera], model: SceneModel, config: TrajectoryConfig
) -> list[Camera]:
    """Returns a closed, smooth path for the scene, with the intrinsics of its first camera.

    Args:
        cameras: The photographs' cameras in the normalised world, at the working size.
        model: Decides between spiral (NDC) and orbit (box).
        config: Length and amplitude.
    """
    focus = np.array(model.focus)
    phases = 2 * np.pi * np.arange(config.frames) / config.frames
    path = _spiral if model.space.kind == "ndc" else _orbit
    centers, targets = path(cameras, focus, phases, config)
    centered = replace(cameras[0], cx=cameras[0].width / 2, cy=cameras[0].height / 2)
    return [
        replace(
            centered,
            name=f"{k:04d}",
            world_from_camera=look_at(center, target, np.array([0, 1, 0])),
        )
        for k, (center, target) in enumerate(zip(centers, targets, strict=True))
    ]


def look_at(
    center: Float[np.ndarray, " 3"], target: Float[np.ndarray, " 3"], down: np.ndarray
) -> Float[np.ndarray, "3 4"]:
    """Returns world_from_camera at `center` with z towards `target` and y near `down`."""
    z = (target - center) / np.linalg.norm(target - center)
    x = np.cross(down, z)
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.column_stack([x, np.cross(z, x), z, center])


Points = Float[np.ndarray, "frames 3"]


def _spiral(
    cameras: Sequence[Camera],
    focus: Float[np.ndarray, " 3"],
    phases: Float[np.ndarray, " frames"],
    config: TrajectoryConfig,
) -> tuple[Points, Points]:
    """The path of LLFF's videos: an ellipse across the view with a slower breath along it."""
    centers = np.stack([camera.center_world for camera in cameras])
    radii = config.spread * np.percentile(np.abs(centers - centers.mean(axis=0)), 90, axis=0)
    angles = config.turns * phases
    waves = np.stack([np.cos(angles), -np.sin(angles), -np.sin(0.5 * angles)], axis=-1)
    if config.turns == 1.0:  # half a breath would not close
        waves[:, 2] = -np.sin(angles)
    path = centers.mean(axis=0) + radii * waves
    return path, np.broadcast_to(focus, path.shape)


def _orbit(
    cameras: Sequence[Camera],
    focus: Float[np.ndarray, " 3"],
    phases: Float[np.ndarray, " frames"],
    config: TrajectoryConfig,
) -> tuple[Points, Points]:
    """Around the vertical through the focus: a full circle, or to and fro over the arc seen."""
    offsets = np.stack([camera.center_world for camera in cameras]) - focus
    azimuths = np.unwrap(np.sort(np.arctan2(offsets[:, 0], offsets[:, 2])))
    gaps = np.diff(np.append(azimuths, azimuths[0] + 2 * np.pi))
    radius = np.median(np.linalg.norm(offsets[:, [0, 2]], axis=1))
    height = np.median(offsets[:, 1])
    if gaps.max() < np.radians(60):
        angles = azimuths[0] + phases
    else:
        start = azimuths[(int(gaps.argmax()) + 1) % len(azimuths)]
        half = (2 * np.pi - gaps.max()) / 2
        angles = start + half + config.spread * half * np.sin(phases)
    rise = config.spread * 0.5 * np.std(offsets[:, 1]) * np.sin(2 * phases)
    path = focus + np.stack(
        [radius * np.sin(angles), height + rise, radius * np.cos(angles)], axis=-1
    )
    return path, np.broadcast_to(focus, path.shape)
