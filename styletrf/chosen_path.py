"""The frames' cameras along a path that is chosen by its name or given in a file."""

from collections.abc import Sequence
from pathlib import Path
from typing import cast, get_args

from styletrf.camera_path import TimedPath, frames_along, timed
from styletrf.cameras import Camera
from styletrf.frames import FramesConfig
from styletrf.lenses import at_size
from styletrf.named_paths import PathName, named_path
from styletrf.path_files import placed_key_frames, read_path
from styletrf.scene_model import SceneModel
from styletrf.typical_view import typical_view


def chosen_path(
    path: str, cameras: Sequence[Camera], model: SceneModel, config: FramesConfig,
    *, are_given: bool,
) -> list[Camera]:  # fmt: skip
    """Returns the cameras of the frames, of the usual size and shape of the photographs.

    Args:
        path: Its name, or where its file is.
        cameras: The photographs', in the normalised world.
        model: Of the scene.
        config: Length, speed, easing, angle of view and so on.
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
