"""Poses as Blender's exporters and instant-ngp keep them: `transforms*.json`.

Per frame a `file_path` and `transform_matrix`, world from camera with OpenGL's axes: x right, y up,
z backwards. The lens is one field of view for all (`camera_angle_x`; Mildenhall et al. 2020), or
`fl_x`, `fl_y`, `cx`, `cy`, `w`, `h` with OpenCV's `k1`, `k2`, `p1`, `p2`, `k3`, for all or in a
frame. Without `w` and `h`, a frame's own lens is for its photograph, and that of all frames for the
first photograph that can be read and those of its proportions, upright or lying; any other has it
at its own size.
A fisheye (`"camera_model": "OPENCV_FISHEYE"`, or `"is_fisheye": true`) has `k1` to `k4`.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from styletrf.capture.photograph_size import first_size
from styletrf.capture.poses.given_poses import (
    GivenPoses,
    GivenView,
    Lens,
    given_poses,
    is_there,
    rigid,
)
from styletrf.capture.poses.transforms_frames import (
    REMEDY,
    Frame,
    frames_in,
    parts_of,
    photograph_named,
)
from styletrf.capture.poses.upright_views import upright_views
from styletrf.errors import InputError

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
_BENDS = {
    "OPENCV": ("k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("k1", "k2", "p1", "p2", "k3"),
    "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"),
}  # names of the distortion parameters, by COLMAP's name of the lens model
_UNREAD = ("k4", "k5", "k6")
"""Parameters of FULL_OPENCV; programs that write `k4` for other lenses define it differently."""
_PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")
_PARAMETERS = {"PINHOLE": 4, "OPENCV": 8, "FULL_OPENCV": 12}
"""The numbers of parameters of COLMAP's models; each model extends the one before it."""


def read_transforms(folder: Path) -> GivenPoses | None:
    """Returns the views in `transforms.json`, else in `transforms_train.json` and `_test.json`.

    The views of `transforms_test.json` are held out. Returns None if neither of the first two files
    exists.

    Raises:
        InputError: A file does not have this format, a matrix is no pose, a photograph lies outside
            the folder, or fewer than three photographs exist.
    """
    parts = parts_of(folder)
    views = [view for path, held_out in parts.items() for view in _views_with(path, held_out)]
    return given_poses(next(iter(parts)), _of_one_model(views)) if parts else None


def _of_one_model(views: Sequence[GivenView]) -> list[GivenView]:
    """Returns the views with lenses of the largest model, of those without fisheyes, among them."""
    most = max((_PARAMETERS.get(view.lens.model, 0) for view in views), default=0)
    return [replace(view, lens=_widened(view.lens, most)) for view in views]


def _widened(lens: Lens, parameters: int) -> Lens:
    """Returns the lens in the model with so many parameters; a fisheye stays as it is."""
    if lens.model not in _PARAMETERS:
        return lens
    (model,) = (name for name, count in _PARAMETERS.items() if count == parameters)
    zeros = (0.0,) * (parameters - len(lens.params))
    return replace(lens, model=model, params=(*lens.params, *zeros))


def transforms_cameras(path: Path) -> list[GivenView]:
    """Returns the views in one file by that file alone: no photograph is read.

    Where it says no size, images are square.

    Raises:
        InputError: The file is not of this format, or a matrix is no pose.
    """
    return [
        GivenView(Path(frame.name), _lens(path, frame.values, None), _pose(path, frame))
        for frame in frames_in(path)
    ]


def _views_with(path: Path, held_out: bool | None) -> list[GivenView]:  # noqa: FBT001
    """Returns the views in one file, whether or not their photographs are there."""
    frames = frames_in(path)
    files = [photograph_named(path, frame.name) for frame in frames]
    views = [
        GivenView(file, _lens(path, frame.values, size), _pose(path, frame), held_out)
        for file, frame, size in zip(files, frames, _sizes(frames, files), strict=True)
    ]
    sized = (view for view, frame in zip(views, frames, strict=True) if frame.has_size)
    upright = iter(upright_views(list(sized)))
    return [
        next(upright) if frame.has_size else view for view, frame in zip(views, frames, strict=True)
    ]


def _sizes(frames: Sequence[Frame], files: Sequence[Path]) -> list[tuple[int, int]]:
    """Returns the sizes of the pictures that lenses are for, where the file gives none."""
    if all(frame.has_size for frame in frames):
        return [(1, 1)] * len(frames)
    of_all, sizes = _first_size(files), []
    for frame, file in zip(frames, files, strict=True):
        own = of_all if frame.has_size else _first_size([file], of_all)
        sizes.append(own if frame.has_own_lens or not _are_alike(own, of_all) else of_all)
    return sizes


def _are_alike(size: tuple[int, int], other: tuple[int, int]) -> bool:
    """Returns whether two sizes have the same proportions, or exchanged ones, within a pixel."""
    (short, long), (other_short, other_long) = sorted(size), sorted(other)
    return abs(short * other_long - other_short * long) <= max(long, other_long)


def _first_size(files: Sequence[Path], otherwise: tuple[int, int] = (1, 1)) -> tuple[int, int]:
    """Returns the size of the first photograph that is there and can be read."""
    if present := [file for file in files if is_there(file)]:
        with suppress(InputError):  # the capture says what is damaged, and leaves it out
            return first_size(present)
    return otherwise


def _pose(path: Path, frame: Frame) -> Float[np.ndarray, "3 4"]:
    """Returns world_from_camera in this project's axes from 4x4 or 3x4 in OpenGL's."""
    is_pose = frame.matrix.ndim == 2 and frame.matrix.shape[1] == 4
    return rigid(frame.name, path, frame.matrix @ _FLIP if is_pose else frame.matrix)


def _lens(path: Path, values: dict[str, Any], size: tuple[int, int] | None) -> Lens:
    """Returns the lens; images have this size where the file gives none.

    Without a size, images are square, which a focal length in pixels does not allow.

    Raises:
        InputError: The lens is not given, impossible, or not read.
    """
    try:
        usual = {} if size is None and "fl_x" in values else {"w": 1, "h": 1}
        sized = {**usual, **dict(zip("wh", size or (), strict=False)), **values}
        width, height = round(float(sized["w"])), round(float(sized["h"]))
        if "fl_x" in values:
            fx = float(values["fl_x"])
        else:
            fx = 0.5 * width / math.tan(0.5 * float(values["camera_angle_x"]))
        fy = float(values.get("fl_y", fx))
        cx, cy = float(values.get("cx", width / 2)), float(values.get("cy", height / 2))
        model = _model(path, values)
        unread = [name for name in _UNREAD if float(values.get(name) or 0)]
        bend = tuple(float(values.get(name, 0)) for name in _BENDS[model])
        bend += (0.0,) * len(_UNREAD) if model == "FULL_OPENCV" else ()
    except (KeyError, TypeError, ValueError, ArithmeticError) as error:
        raise InputError(str(path), f"has no lens ({error!r})", REMEDY) from error
    if (
        unread and model != "OPENCV_FISHEYE" and size is not None
    ):  # else only the angle of view counts
        problem = (
            f"has distortion that is not read, of a lens that is no fisheye: {', '.join(unread)}"
        )
        raise InputError(str(path), problem, "Export it with k1, k2, k3, p1 and p2 alone")
    numbers = (fx, fy, cx, cy, *bend)
    if min(fx, fy, width, height) <= 0 or not all(map(math.isfinite, numbers)):
        problem = f"has an impossible lens: {numbers} of {width}x{height} pixels"
        raise InputError(str(path), problem, REMEDY)
    if any(bend) or model == "OPENCV_FISHEYE":
        return Lens(model, numbers, width, height)
    return Lens("PINHOLE", numbers[:4], width, height)


def _model(path: Path, values: dict[str, Any]) -> str:
    """Returns COLMAP's name of the lens model; a pinhole is one of OpenCV's without distortion.

    Raises:
        InputError: The file names a model that is not read.
    """
    usual = "OPENCV_FISHEYE" if values.get("is_fisheye") else "OPENCV"
    model = str(values.get("camera_model", usual)).upper()
    if model not in (*_PINHOLES, *_BENDS):
        known = ", ".join((*_PINHOLES, *_BENDS))
        raise InputError(
            str(path), f"has the lens model {model}, which is not read", f"Known are {known}"
        )
    if model == "OPENCV_FISHEYE":
        return model
    return "FULL_OPENCV" if float(values.get("k3") or 0) else "OPENCV"
