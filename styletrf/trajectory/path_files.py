"""Camera paths in files: key frames as JSON, Blender's `transforms.json`, a COLMAP model.

Blender's cameras are an animation of 24 frames a second, COLMAP's are places in the order of their
names. Both are in the world of the poses that came with the photographs: where the poses were
solved from the photographs alone, nothing says how the two worlds lie to each other. They may be
those of pictures as a phone stores them, on their side: cameras turn as the photographs at their
places did.
"""

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from styletrf.capture.poses.colmap_model import colmap_views
from styletrf.capture.poses.given_poses import Lens
from styletrf.capture.poses.transforms_json import transforms_cameras
from styletrf.colmap import pycolmap
from styletrf.errors import InputError
from styletrf.geometry.cameras import Camera, moved
from styletrf.geometry.lenses import focal_from, with_focal
from styletrf.geometry.rotations import matrices_of, quaternions_of
from styletrf.geometry.typical_view import typical_view
from styletrf.scene.scene_model import SceneModel
from styletrf.trajectory.camera_curve import Poses
from styletrf.trajectory.key_frames import (
    ANIMATION_RATE,
    LONGEST_S,
    KeyFrame,
    KeyFrames,
    key_frames_of,
)
from styletrf.trajectory.named_paths import poses_of
from styletrf.trajectory.trajectories import look_at

_EXPORT = "Export the cameras again, or give another --path (docs/paths.md)"
_NAMED = 10  # photographs that an error lists
_SAME_PLACE = 0.05  # in the normalized world, and of an axis: given poses may have been adjusted
_LEAST_AT_PHOTOGRAPHS = 0.5  # of the cameras of a model of the photographs
_DOWN = np.array([0.0, 1.0, 0.0])


def read_path(path: Path) -> KeyFrames:
    """Returns the key frames in a file, or in the folder of a COLMAP model.

    Raises:
        InputError: The file has none of the formats; the error names it, and the entry at fault.
    """
    if path.is_dir():
        return _of_views(path, timed=False)
    try:
        values: Any = json.loads(path.read_text())
    except OSError as error:
        remedy = "Give auto, orbit, spiral, dolly, photographs, or the path of a file"
        problem = f"cannot be read ({error.strerror})"
        raise InputError(f"--path {path}", problem, remedy) from error
    except (ValueError, RecursionError) as error:
        raise InputError(str(path), f"is no JSON ({error})", "See docs/paths.md") from error
    if isinstance(values, dict) and "key_frames" in values:
        return key_frames_of(path, values)
    if isinstance(values, dict) and "frames" in values:
        return _of_views(path, timed=True)
    problem = "has neither key_frames nor, as Blender's transforms.json, frames"
    raise InputError(str(path), problem, "See docs/paths.md")


def placed_key_frames(
    keys: KeyFrames, cameras: Sequence[Camera], model: SceneModel, *, are_given: bool
) -> Poses:
    """Returns the poses of key frames in the normalized world.

    Args:
        keys: The key frames that `read_path` returned.
        cameras: The photographs', in the normalized world.
        model: The model of the scene, with the similarity between the normalized world and the
            capture's.
        are_given: Whether the poses of the photographs came with them.

    Raises:
        InputError: A photograph has no camera, or the two worlds have nothing in common.
    """
    require_common_world(keys, are_given=are_given)
    known, usual = {camera.name: camera for camera in cameras}, typical_view(cameras)
    require_photographs(keys, list(known))
    placed = [_placed(frame, known, model, usual) for frame in keys.frames]
    return poses_of(_upright(placed, cameras) if keys.of_given_poses else placed)


def require_common_world(keys: KeyFrames, *, are_given: bool) -> None:
    """Refuses cameras of another world than the photographs'.

    Args:
        keys: Key frames that may be in the world of the poses that came with the photographs.
        are_given: Whether poses came with the photographs.

    Raises:
        InputError: No poses came with them, so that nothing says where in the scene the cameras
            are.
    """
    if keys.of_given_poses and not are_given:
        raise InputError(
            keys.source,
            "has cameras in a world of their own, and the poses of this scene are solved from its"
            " photographs, in another one",
            "Give the photographs' poses in that world beside them, or key frames (docs/paths.md)",
        )


def require_photographs(keys: KeyFrames, names: Sequence[str]) -> None:
    """Refuses key frames at photographs that a scene does not have.

    Args:
        keys: Key frames that may name photographs, with the suffixes of their files or without.
        names: The names of the scene's photographs.

    Raises:
        InputError: A photograph is missing; the error lists some that exist.
    """
    for k, frame in enumerate(keys.frames):
        if frame.photograph and not {frame.photograph, Path(frame.photograph).stem} & set(names):
            problem = (
                f"key_frames[{k}].photograph is {frame.photograph!r}, which has no camera here"
            )
            existing = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
            raise InputError(keys.source, problem, f"Photographs of this scene are {existing}")


def names_asked(keys: KeyFrames) -> set[str]:
    """Returns the names that photographs of key frames may have, as written or without suffix."""
    photographs = [frame.photograph for frame in keys.frames if frame.photograph]
    return {*photographs, *(Path(photograph).stem for photograph in photographs)}


def _placed(frame: KeyFrame, known: dict[str, Camera], model: SceneModel, usual: Camera) -> Camera:
    if frame.photograph:
        name = frame.photograph
        camera = known[name if name in known else Path(name).stem]
    else:
        camera = _at_position(frame, model, usual)
    return camera if frame.fov_deg is None else with_focal(camera, focal_from(frame.fov_deg))


def _at_position(frame: KeyFrame, model: SceneModel, usual: Camera) -> Camera:
    position = np.array(frame.position_world)
    quaternion = np.array([frame.orientation or (1.0, 0.0, 0.0, 0.0)])
    pose = np.column_stack([matrices_of(quaternion)[0], position])
    camera = moved(replace(usual, world_from_camera=pose), model.normalized_from_world)
    if frame.look_at_world is None:
        return camera
    target = model.normalized_from_world @ np.array([*frame.look_at_world, 1.0])
    return replace(usual, world_from_camera=look_at(camera.center_world, target[:3], _DOWN))


def _upright(placed: Sequence[Camera], photographs: Sequence[Camera]) -> list[Camera]:
    """Returns cameras turned by quarters about their axes so that they stand as photographs do.

    A camera that is at no photograph turns as most others. All stay as they are if fewer than half
    are at a photograph of their own: an animation passes photographs by chance, and those of a
    drone that flies back and forth stand either way.
    """
    poses = np.stack([photograph.world_from_camera for photograph in photographs])
    found = [_photograph_at(camera, poses) for camera in placed]
    own = {place[0]: place[1] for place in found if place}
    if len(own) < _LEAST_AT_PHOTOGRAPHS * len(placed):
        return list(placed)
    usual = Counter(own.values()).most_common(1)[0][0]
    turns = [place[1] if place else usual for place in found]
    return [_rolled(camera, -turn) for camera, turn in zip(placed, turns, strict=True)]


def _photograph_at(
    camera: Camera, poses: Float[np.ndarray, "photographs 3 4"]
) -> tuple[int, int] | None:
    """Returns the photograph at a camera's place and axis, and the camera's roll from it.

    The roll is in quarters; it is 0 where photographs there are rolled from each other. None stands
    for no photograph.
    """
    own = camera.world_from_camera
    x, y = own[:, 0] @ poses[:, :, 0].T, own[:, 0] @ poses[:, :, 1].T
    quarters = np.arctan2(y, x) / (np.pi / 2)
    whole = np.rint(quarters)
    off = np.linalg.norm(poses[:, :, 2:] - own[:, 2:], axis=1).max(axis=1)
    off = np.maximum(off, np.abs(quarters - whole))
    rolls = set((whole[off < _SAME_PLACE] % 4).astype(int).tolist())
    if not rolls:
        return None
    return int(off.argmin()), rolls.pop() if len(rolls) == 1 else 0


def _rolled(camera: Camera, quarters: int) -> Camera:
    """Returns the camera with x and y turned about its axis by quarters, from x to y."""
    turned = camera.world_from_camera.copy()
    for _ in range(quarters % 4):
        turned[:, :2] = np.column_stack([turned[:, 1], -turned[:, 0]])
    return replace(camera, world_from_camera=turned)


def _of_views(path: Path, *, timed: bool) -> KeyFrames:
    try:
        views = transforms_cameras(path) if timed else colmap_views(path, path)
    except InputError as error:  # whose remedy is for the poses of a capture
        raise InputError(error.subject, error.problem, _EXPORT) from error
    if not views:
        raise InputError(str(path), "has no cameras", _EXPORT)
    seconds = (len(views) - 1) / ANIMATION_RATE
    if timed and seconds > LONGEST_S:
        problem = f"is an animation of {seconds:g} seconds, and a path takes up to {LONGEST_S:g}"
        raise InputError(str(path), problem, "Export fewer frames")
    frames = [
        KeyFrame(
            position_world=tuple(view.world_from_camera[:, 3].tolist()),
            orientation=tuple(quaternions_of(view.world_from_camera[None, :, :3])[0].tolist()),
            fov_deg=_fov_deg(view.lens),
            time_s=k / ANIMATION_RATE if timed else None,
        )
        for k, view in enumerate(views)
    ]
    return KeyFrames(str(path), tuple(frames), of_given_poses=True)


def _fov_deg(lens: Lens) -> float | None:
    """Returns the angle of view along the longer side, in degrees; None for that of a panorama."""
    camera = pycolmap.Camera(**asdict(lens))
    if not camera.focal_length_idxs():  # to ask for its focal length ends the process
        return None
    is_lying = camera.width >= camera.height
    focal_px = camera.focal_length_x if is_lying else camera.focal_length_y
    return math.degrees(2 * math.atan(0.5 * max(camera.width, camera.height) / focal_px))
