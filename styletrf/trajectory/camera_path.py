"""The cameras of the frames: along the default path, a named one, or the user's key frames."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera
from styletrf.geometry.lenses import with_focal
from styletrf.geometry.rotations import matrices_of
from styletrf.trajectory.camera_curve import Poses, curve_through, eased
from styletrf.trajectory.key_frames import KeyFrames
from styletrf.trajectory.trajectory_config import TrajectoryConfig


@dataclass(frozen=True, slots=True)
class TimedPath:
    """Key frames in the normalized world, and when the camera is at each.

    `times_s` begin at 0. Without them the camera moves at an even speed.
    """

    poses: Poses
    closed: bool = False
    easing: float = 0.0
    times_s: tuple[float, ...] = ()


def timed(keys: KeyFrames, poses: Poses) -> TimedPath:
    """Returns the path through placed key frames; it waits at the first one until its time."""
    times = tuple(frame.time_s for frame in keys.frames if frame.time_s is not None)
    if times and times[0] > 0:
        values = (poses.centers, poses.quaternions, poses.focals)
        poses = Poses(*(np.concatenate([of_all[:1], of_all]) for of_all in values))
        times = (0.0, *times)
    return TimedPath(poses, keys.closed, keys.easing, times)


def frames_along(
    path: TimedPath, photograph: Camera, config: TrajectoryConfig, frames_per_second: float | int
) -> list[Camera]:
    """Returns the cameras of the frames, with the shape of a photograph.

    The first frame is the first key frame. The last one is the last key frame; of a closed path
    the one after it would be the first again.

    Args:
        path: The path of the camera.
        photograph: The camera whose shape the frames have.
        config: The length, speed, easing and angle of view.
        frames_per_second: The rate of the video.
    """
    times = np.array(path.times_s)
    curve = curve_through(path.poses, closed=path.closed)
    if len(times) > 1:
        count = config.count(frames_per_second, times[-1])
        poses = curve.at_times(np.linspace(0, times[-1], count), times)
    else:
        count = config.count(frames_per_second)
        time = np.arange(count) / (count if path.closed else max(count - 1, 1))
        poses = curve.at_fractions(eased(time, config.easing or path.easing))
    return [
        replace(with_focal(photograph, focal), name=f"{k:04d}", world_from_camera=pose)
        for k, (pose, focal) in enumerate(zip(_matrices(poses), poses.focals, strict=True))
    ]


def _matrices(poses: Poses) -> Float[np.ndarray, "frames 3 4"]:
    return np.concatenate([matrices_of(poses.quaternions), poses.centers[:, :, None]], axis=2)
