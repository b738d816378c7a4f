"""Poses as Blender's exporters and instant-ngp keep them: `transforms*.json`.

Per frame a `file_path` and `transform_matrix`, world from camera with OpenGL's axes: x right, y up,
z backwards. The lens is one field of view for all (`camera_angle_x`; Mildenhall et al. 2020), or
`fl_x`, `fl_y`, `cx`, `cy`, `w`, `h` with OpenCV's `k1`, `k2`, `p1`, `p2`, `k3`, for all or in a
frame.
A fisheye (`"camera_model": "OPENCV_FISHEYE"`, or `"is_fisheye": true`) has `k1` to `k4`.
"""

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from styletrf.capture.photograph_size import photograph_size
from styletrf.capture.poses.given_poses import (
    GivenPoses,
    GivenView,
    Lens,
    given_poses,
    require_inside,
    rigid,
)
from styletrf.errors import InputError

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
_SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".JPG", ".PNG")
_REMEDY = "Export the scene again, or move the file away: then poses are estimated"
_BENDS = {
    "OPENCV": ("k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("k1", "k2", "p1", "p2", "k3"),
    "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"),
}  # names of the distortion parameters, by COLMAP's name of the lens model
_UNREAD = ("k4", "k5", "k6")
"""Parameters of FULL_OPENCV; programs that write `k4` for other lenses define it differently."""
_PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")


def read_transforms(folder: Path) -> GivenPoses | None:
    """Returns the views in `transforms.json`, else in `transforms_train.json` and `_test.json`.

    The views of `transforms_test.json` are held out. Returns None if neither of the first two files
    exists.

    Raises:
        InputError: A file does not have this format, a matrix is no pose, a photograph lies outside
            the folder, or fewer than three photographs exist.
    """
    parts = _parts(folder)
    views = [view for path, held_out in parts.items() for view in _views_with(path, held_out)]
    return given_poses(next(iter(parts)), _of_one_model(views)) if parts else None


def _of_one_model(views: Sequence[GivenView]) -> list[GivenView]:
    """Returns the views with lenses of COLMAP's largest model of OpenCV if one of them needs it."""
    if all(view.lens.model != "FULL_OPENCV" for view in views):
        return list(views)
    return [replace(view, lens=_widened(view.lens)) for view in views]


def _widened(lens: Lens) -> Lens:
    """Returns the same pinhole or OpenCV lens as one of `FULL_OPENCV`."""
    if lens.model not in ("PINHOLE", "OPENCV"):
        return lens
    return replace(lens, model="FULL_OPENCV", params=(*lens.params, *[0.0] * 8)[:12])


def transforms_photographs(folder: Path) -> list[Path]:
    """Returns the photographs that `read_transforms` reads, by the paths that name them.

    Raises:
        InputError: A file is not of this format, or names a photograph outside the folder.
    """
    files = [_file(path, name) for path in _parts(folder) for name, _, _ in _frames(path)]
    return [file for file in files if file.is_file()]


def transforms_cameras(path: Path) -> list[GivenView]:
    """Returns the views in one file by that file alone: no photograph is read.

    Where it says no size, images are square.

    Raises:
        InputError: The file is not of this format, or a matrix is no pose.
    """
    return [
        GivenView(Path(name), _lens(path, values, None), _pose(name, path, pose))
        for name, pose, values in _frames(path)
    ]


def _parts(folder: Path) -> dict[Path, bool | None]:
    """Returns the files that hold a scene's poses, and whether their photographs are held out."""
    whole, train, test = (folder / f"transforms{part}.json" for part in ("", "_train", "_test"))
    if whole.exists():
        return {whole: None}
    if not train.exists():
        return {}
    return {train: False, test: True} if test.exists() else {train: None}


def _frames(path: Path) -> list[tuple[str, np.ndarray, dict[str, Any]]]:
    """Returns the photograph's name, the matrix and the lens parameters of each frame."""
    try:
        values = json.loads(path.read_text())
        return [
            (
                str(frame["file_path"]),
                np.array(frame["transform_matrix"], dtype=np.float64),
                {**values, **frame},
            )
            for frame in values["frames"]
        ]
    except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
        raise InputError(str(path), "is no transforms file", _REMEDY) from error


def _views_with(path: Path, held_out: bool | None) -> list[GivenView]:  # noqa: FBT001
    """Returns the views in one file, whether or not their photographs are there."""
    frames = _frames(path)
    files = [_file(path, name) for name, _, _ in frames]
    return [
        GivenView(file, _lens(path, values, _size(file, values)), _pose(name, path, pose), held_out)
        for file, (name, pose, values) in zip(files, frames, strict=True)
    ]


def _size(file: Path, values: dict[str, Any]) -> tuple[int, int]:
    """Returns a photograph's own size where the file of poses gives none and it can be read."""
    if not {"w", "h"} <= values.keys() and file.is_file():
        with suppress(InputError):  # the capture says what is damaged, and leaves it out
            return photograph_size(file)
    return 1, 1


def _pose(name: str, path: Path, pose: np.ndarray) -> Float[np.ndarray, "3 4"]:
    """Returns world_from_camera in this project's axes from 4x4 or 3x4 in OpenGL's."""
    return rigid(name, path, pose @ _FLIP if pose.ndim == 2 and pose.shape[1] == 4 else pose)


def _file(path: Path, name: str) -> Path:
    """Returns the photograph of a `file_path`, which may lack its suffix, below the file's folder.

    Raises:
        InputError: It lies outside the folder of the file that names it.
    """
    candidates = [path.parent / f"{name}{suffix}" for suffix in _SUFFIXES]
    file = next((each for each in candidates if each.is_file()), candidates[0])
    require_inside(path, path.parent, file)
    if file.is_relative_to(path.parent):
        return file
    return path.parent / file.resolve().relative_to(path.parent.resolve())  # an absolute path


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
        raise InputError(str(path), f"has no lens ({error!r})", _REMEDY) from error
    if (
        unread and model != "OPENCV_FISHEYE" and size is not None
    ):  # else only the angle of view counts
        problem = (
            f"has distortion that is not read, of a lens that is no fisheye: {', '.join(unread)}"
        )
        raise InputError(str(path), problem, "Export it with k1, k2, k3, p1 and p2 alone")
    numbers = (fx, fy, cx, cy, *bend)
    if min(fx, fy) <= 0 or not all(map(math.isfinite, numbers)):
        raise InputError(str(path), f"has an impossible lens: {numbers}", _REMEDY)
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
