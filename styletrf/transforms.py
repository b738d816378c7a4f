"""Poses as Blender's exporters and instant-ngp keep them: `transforms*.json`.

Per frame a `file_path` and `transform_matrix`, world from camera with OpenGL's axes: x right, y up,
z backwards. The lens is one field of view for all (`camera_angle_x`; Mildenhall et al. 2020), or
`fl_x`, `fl_y`, `cx`, `cy`, `w`, `h` with OpenCV's `k1`, `k2`, `p1`, `p2`, for all or in a frame.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from styletrf.errors import InputError
from styletrf.given_poses import GivenPoses, GivenView, Lens, given_poses, rigid
from styletrf.photographs import read_photograph

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
_SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".JPG", ".PNG")
_REMEDY = "Export the scene again"


def read_transforms(folder: Path) -> GivenPoses | None:
    """Returns the views in `transforms.json`, or those in `transforms_train.json` and `_test`.

    Those of `_test` are held out. None where there is neither.

    Raises:
        InputError: A file is not of this format, a pose is none, or hardly a photograph is there.
    """
    whole, train = folder / "transforms.json", folder / "transforms_train.json"
    if not whole.exists() and not train.exists():
        return None
    parts: dict[Path, bool | None] = {whole: None}
    if not whole.exists():
        test = folder / "transforms_test.json"
        parts = {train: False, test: True} if test.exists() else {train: None}
    views = [view for path, held_out in parts.items() for view in transforms_views(path, held_out)]
    source = next(iter(parts))
    return given_poses(source, views)


def transforms_views(path: Path, held_out: bool | None = None) -> list[GivenView]:  # noqa: FBT001
    """Returns the views in one file, whether or not their photographs are there.

    Raises:
        InputError: The file is not of this format, or a pose is none.
    """
    try:
        values = json.loads(path.read_text())
        frames = [(str(frame["file_path"]), frame) for frame in values["frames"]]
        poses = [np.array(frame["transform_matrix"], dtype=np.float64) for _, frame in frames]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(str(path), "is no transforms file", _REMEDY) from error
    files = [_file(path.parent, name) for name, _ in frames]
    present = next((file for file in files if file.is_file()), None)
    size = read_photograph(present).shape[1::-1] if present else (1, 1)
    return [
        GivenView(
            file,
            _lens(path, {**values, **frame}, size),
            rigid(name, path, pose @ _FLIP if pose.shape == (4, 4) else pose),
            held_out,
        )
        for file, (name, frame), pose in zip(files, frames, poses, strict=True)
    ]


def _file(folder: Path, name: str) -> Path:
    """Returns the photograph of a `file_path`, which may lack its suffix."""
    candidates = [folder / f"{name}{suffix}" for suffix in _SUFFIXES]
    return next((path for path in candidates if path.is_file()), candidates[0])


def _lens(path: Path, values: dict[str, Any], size: tuple[int, int]) -> Lens:
    try:
        width, height = (round(float(values.get(k, n))) for k, n in zip("wh", size, strict=True))
        if "fl_x" in values:
            fx = float(values["fl_x"])
        else:
            fx = 0.5 * width / math.tan(0.5 * float(values["camera_angle_x"]))
        fy = float(values.get("fl_y", fx))
        cx, cy = float(values.get("cx", width / 2)), float(values.get("cy", height / 2))
        bend = tuple(float(values.get(name, 0)) for name in ("k1", "k2", "p1", "p2"))
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise InputError(str(path), f"tells no lens ({error!r})", _REMEDY) from error
    numbers = (fx, fy, cx, cy, *bend)
    if min(fx, fy) <= 0 or not all(map(math.isfinite, numbers)):
        raise InputError(str(path), f"tells an impossible lens: {numbers}", _REMEDY)
    if any(bend):
        return Lens("OPENCV", numbers, width, height)
    return Lens("PINHOLE", numbers[:4], width, height)
