"""Camera paths: a spiral where the photographers looked ahead, an orbit, or the way they went.

All paths are in the normalized world, whose y axis points down. They stay within the parts that the
photographs saw: amplitudes are fractions of the spread of the given cameras. `fly_through` is the
closed path of the video, `prior_views` the viewpoints that fill the volume that it goes around or
along.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera
from styletrf.geometry.typical_view import typical_view
from styletrf.scene.scene_model import SceneModel
from styletrf.trajectory.camera_curve import eased
from styletrf.trajectory.camera_ring import ring_of
from styletrf.trajectory.trajectory_config import TrajectoryConfig
from styletrf.trajectory.walkthrough import smoothed_walkthrough

Points = Float[np.ndarray, "frames 3"]
Fractions = Float[np.ndarray, " frames"]

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def fly_through(
    cameras: Sequence[Camera], model: SceneModel, config: TrajectoryConfig
) -> list[Camera]:
    """Returns a closed, smooth path for the scene, with the intrinsics of a typical photograph.

    Args:
        cameras: The photographs' cameras in the normalized world, at the working size.
        model: Decides between spiral and orbit, and where the frames look.
        config: The length and the amplitude.
    """
    fractions = eased(np.arange(config.frames) / config.frames, config.easing)
    if model.looking == "ahead":
        centers = ellipse(cameras, fractions, config.turns, config.spread)
    elif model.looking == "along":
        return facing(*smoothed_walkthrough(cameras, fractions, back=True), typical_view(cameras))
    else:
        centers = orbit(cameras, model, fractions, config.spread)
    return looking(centers, typical_view(cameras), model)


def ellipse(cameras: Sequence[Camera], fractions: Fractions, turns: float, spread: float) -> Points:
    """Returns centers on an ellipse across the views, at fractions of a closed path.

    The path goes around `turns` times, and once to and fro along the views.
    """
    phases = 2 * np.pi * fractions
    across = turns * phases
    waves = np.stack([np.cos(across), -np.sin(across), -np.sin(phases)], axis=-1)
    return _before_the_scene(cameras, waves, spread)


def orbit(
    cameras: Sequence[Camera], model: SceneModel, fractions: Fractions, spread: float
) -> Points:
    """Returns centers around the vertical through the focus, at fractions of a closed path.

    Where the photographs are on an arc only, they go to and fro on it.
    """
    ring, phases = ring_of(cameras, model), 2 * np.pi * fractions
    along = fractions if ring.closed else 0.5 + 0.5 * spread * np.sin(phases)
    return ring.points(along, 0.5 + 0.5 * spread * np.sin(2 * phases))


def prior_views(
    cameras: Sequence[Camera], model: SceneModel, config: TrajectoryConfig
) -> list[Camera]:
    """Returns viewpoints, no two alike, spread evenly over the volume within the fly-through.

    Before a forward-facing scene they lie like a sunflower's seeds (Vogel 1979) over the ellipse;
    around another at evenly spaced azimuths, low and high by turns; along a walk at evenly spaced
    places.
    """
    index = np.arange(config.frames)
    if model.looking == "ahead":
        angles = GOLDEN_ANGLE * index
        seeds = np.stack([np.cos(angles), -np.sin(angles), -np.sin(angles)], axis=-1)
        seeds *= np.sqrt((index + 0.5) / config.frames)[:, None]
        centers = _before_the_scene(cameras, seeds, config.spread)
    elif model.looking == "along":
        even = (index + 0.5) / config.frames
        return facing(*smoothed_walkthrough(cameras, even, back=False), typical_view(cameras))
    else:
        ring = ring_of(cameras, model)
        even = (index + 0.5) / config.frames
        along = even if ring.closed else 0.5 + config.spread * (even - 0.5)
        centers = ring.points(along, 0.5 + config.spread * (index % 2 - 0.5))
    return looking(centers, typical_view(cameras), model)


def look_at(
    center: Float[np.ndarray, " 3"], target: Float[np.ndarray, " 3"], down: np.ndarray
) -> Float[np.ndarray, "3 4"]:
    """Returns world_from_camera at `center` with z towards `target` and y near `down`.

    At the target itself the camera looks along the world's z.
    """
    distance = np.linalg.norm(target - center)
    z = (target - center) / distance if distance > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(down, z)
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.column_stack([x, np.cross(z, x), z, center])


def looking(centers: Points, photograph: Camera, model: SceneModel) -> list[Camera]:
    """Returns cameras at the centers that look at the focus, or away from it."""
    focus = np.array(model.focus)
    return facing(
        centers, centers - focus if model.looking == "outward" else focus - centers, photograph
    )


def facing(centers: Points, directions: Points, photograph: Camera) -> list[Camera]:
    """Returns level cameras at the centers, with the intrinsics of a photograph."""
    centered = replace(photograph, cx=photograph.width / 2, cy=photograph.height / 2)
    return [
        replace(
            centered,
            name=f"{k:04d}",
            world_from_camera=look_at(center, center + direction, np.array([0, 1, 0])),
        )
        for k, (center, direction) in enumerate(zip(centers, directions, strict=True))
    ]


def _before_the_scene(cameras: Sequence[Camera], fractions: Points, spread: float) -> Points:
    """Returns points at fractions of the ellipsoid that the cameras fill."""
    centers = np.stack([camera.center_world for camera in cameras])
    radii = spread * np.percentile(np.abs(centers - centers.mean(axis=0)), 90, axis=0)
    points: Points = centers.mean(axis=0) + radii * fractions
    return points
