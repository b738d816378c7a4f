"""Paths by name, as key frames in the normalized world: orbit, spiral, dolly, photographs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera
from styletrf.geometry.lenses import focal_of
from styletrf.geometry.rotations import quaternions_of
from styletrf.geometry.typical_view import typical_view
from styletrf.scene.placement import mean_view
from styletrf.scene.scene_model import SceneModel
from styletrf.trajectory.camera_curve import Poses
from styletrf.trajectory.camera_ring import ring_of
from styletrf.trajectory.trajectories import ellipse, facing, looking, orbit
from styletrf.trajectory.trajectory_config import TrajectoryConfig
from styletrf.trajectory.walkthrough import is_closed, looks_all_around, onwards, weights_between

PathName = Literal["orbit", "spiral", "dolly", "photographs"]

_KEYS = 96  # of a path that is given in closed form, at least
_KEYS_OF_TURN = 24
_TURNS = 2.0  # of a spiral, at least: one is an orbit
_ADVANCE = 0.5  # of the way to the focus, that a dolly goes at a spread of 1


@dataclass(frozen=True, slots=True)
class NamedPath:
    """Key frames in the normalized world, and whether the path returns to the first."""

    poses: Poses
    closed: bool


def named_path(
    name: PathName, cameras: Sequence[Camera], model: SceneModel, config: TrajectoryConfig
) -> NamedPath:
    """Returns a path by its name; finite for any cameras, one or several at one place.

    - orbit: around the vertical through the focus, where and as high as photographs were taken.
    - spiral: before a forward-facing scene an ellipse of two turns or more, once to and fro;
      around another as many turns up and down.
    - dolly: straight ahead from the photograph that looks most as all do, towards the focus.
    - photographs: the way of the photographs in their own order, smoothed. Where their views look
      all around along it, as those of panoramas, the way looks ahead.

    Args:
        name: The name of the path.
        cameras: The photographs', in the normalized world.
        model: The model of the scene: its focus, and how the photographers looked.
        config: The spread, turns and stabilization of the path.
    """
    if name == "photographs":
        # Directions also cancel around an object or a room, where nobody looked all around.
        is_walk = model.looking == "along"
        if is_walk and looks_all_around(cameras, config.stabilization):
            way = onwards(cameras, config.stabilization)
            cameras = facing(*way, typical_view(cameras))
        return _through_photographs(cameras, config.stabilization)
    if name == "dolly":
        return NamedPath(_dolly(cameras, model, config.spread), closed=False)
    if name == "orbit":
        centers = orbit(cameras, model, np.arange(_KEYS) / _KEYS, config.spread)
    else:
        centers = _spiral(cameras, model, config)
    return NamedPath(poses_of(looking(centers, typical_view(cameras), model)), closed=True)


def poses_of(cameras: Sequence[Camera]) -> Poses:
    """Returns the poses of cameras."""
    return Poses(
        np.stack([camera.center_world for camera in cameras]),
        quaternions_of(np.stack([camera.world_from_camera[:, :3] for camera in cameras])),
        np.array([focal_of(camera) for camera in cameras]),
    )


def _spiral(
    cameras: Sequence[Camera],
    model: SceneModel,
    config: TrajectoryConfig,
) -> Float[np.ndarray, "keys 3"]:
    turns = max(config.turns, _TURNS)
    count = max(_KEYS, round(_KEYS_OF_TURN * turns))
    fractions = np.arange(count) / count
    if model.looking == "ahead":
        return ellipse(cameras, fractions, turns, config.spread)
    ring, phases = ring_of(cameras, model), 2 * np.pi * fractions
    to_and_fro = 0.5 + 0.5 * config.spread * np.sin(turns * phases)
    along = turns * fractions if ring.closed else to_and_fro
    return ring.points(along, 0.5 - 0.5 * config.spread * np.cos(phases))


def _dolly(cameras: Sequence[Camera], model: SceneModel, spread: float) -> Poses:
    mean = mean_view(cameras)
    first = max(cameras, key=lambda camera: float(camera.forward_world @ mean))
    depth = float((np.array(model.focus) - first.center_world) @ first.forward_world)
    way = _ADVANCE * spread * max(depth, 2 * model.space.depth_min)
    start = poses_of([first, first])
    centers = start.centers + np.outer([0.0, way], first.forward_world)
    return Poses(centers, start.quaternions, start.focals)


def _through_photographs(cameras: Sequence[Camera], deviation: float) -> NamedPath:
    """Returns the photographs' own poses, each the mean of those near it by their number."""
    poses = poses_of(cameras)
    weights = weights_between(poses.centers, deviation)
    rotations = np.stack([camera.world_from_camera[:, :3] for camera in cameras])
    mean = np.einsum("ij,jkl->ikl", weights, rotations)
    u, _, vt = np.linalg.svd(mean)
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    focals = np.exp(weights @ np.log(poses.focals))
    smoothed = Poses(weights @ poses.centers, quaternions_of(u @ vt), focals)
    return NamedPath(smoothed, is_closed(poses.centers))
