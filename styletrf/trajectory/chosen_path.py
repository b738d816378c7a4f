"""The cameras of the frames along the default path, a path chosen by its name, or one in a file."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast, get_args

import numpy as np

from styletrf.geometry.cameras import Camera
from styletrf.geometry.lenses import at_size
from styletrf.geometry.typical_view import typical_view
from styletrf.scene.scene_model import SceneModel
from styletrf.trajectory.camera_path import TimedPath, frames_along, timed
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.named_paths import PathName, named_path
from styletrf.trajectory.path_files import placed_key_frames, read_path
from styletrf.trajectory.stills import stills
from styletrf.trajectory.support import Support
from styletrf.trajectory.supported_path import SupportedPath, supported_fly_through

_ONE_PLACE = 1e-6  # in the normalized world


def default_path(
    cameras: Sequence[Camera], model: SceneModel, config: FramesConfig,
    measure: Callable[[Sequence[Camera]], Support], *, has_parallax: bool,
) -> SupportedPath:  # fmt: skip
    """Returns the widest fly-through that the photographs support, or stills.

    It returns stills in two cases. The photographs contain no depth, as those of one place, or too
    few photographs see much of even the narrowest fly-through. If the user set an angle of view,
    the second case does not apply.

    Args:
        cameras: The photographs', in the normalized world.
        model: Of the scene.
        config: The length, spread, angle of view, and the limit.
        measure: Returns the support of a path.
        has_parallax: Whether there is parallax between the photographs.
    """
    n_frames = config.trajectory.count(config.frames_per_second)
    trajectory = replace(config.trajectory, frames=n_frames)
    reason, found = "the photographs tell no depth", None
    centers = np.stack([camera.center_world for camera in cameras])
    if has_parallax and np.ptp(centers, axis=0).max() > _ONE_PLACE:
        found = supported_fly_through(cameras, model, trajectory, measure, config.support)
        if found.support.fraction < config.support.least_for_stills or trajectory.fov_deg:
            return found
        reason = (
            f"of any fly-through at least {found.support.fraction:.1%} of the pixels are seen by"
            " too few photographs"
        )
    views, shown = stills(cameras, n_frames, config.frames_per_second)
    views = [at_size(camera, 0, trajectory.fov_deg) for camera in views]
    return SupportedPath(views, measure(views), found.trials if found else (), shown, reason)


def chosen_path(
    path: str, cameras: Sequence[Camera], model: SceneModel, config: FramesConfig,
    *, are_given: bool,
) -> list[Camera]:  # fmt: skip
    """Returns the cameras of the frames, of the usual size and shape of the photographs.

    Args:
        path: Its name, or the path of its file.
        cameras: The photographs', in the normalized world.
        model: Of the scene.
        config: The length, speed, easing, angle of view and so on.
        are_given: Whether the poses of the photographs came with them.

    Raises:
        InputError: The file is no path, or cannot be placed in the scene.
    """
    if path in get_args(PathName):
        named = named_path(cast("PathName", path), cameras, model, config.trajectory)
        way = TimedPath(named.poses, named.closed)
    else:
        keys = read_path(Path(path))
        way = timed(keys, placed_key_frames(keys, cameras, model, are_given=are_given))
    frames = frames_along(way, typical_view(cameras), config.trajectory, config.frames_per_second)
    return [at_size(camera, 0, config.trajectory.fov_deg) for camera in frames]
