"""Poses as NeRF's synthetic scenes keep them: `transforms_*.json` (Mildenhall et al. 2020).

One horizontal field of view for all, the optical axis through the middle of the image, and per
frame `transform_matrix`, world from camera with OpenGL's axes: x right, y up, z backwards.
"""

import json
import math
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.cameras import Camera
from styletrf.errors import InputError

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
_REMEDY = "Export the scene again"


def read_blender_cameras(path: Path, width: int, height: int) -> list[Camera]:
    """Returns the cameras of frames of `width` x `height`, in the file's order.

    A camera's name is the frame's `file_path` without leading dots: where its image lies below
    the file's folder, without the suffix.

    Raises:
        InputError: The file is not of this format.
    """
    try:
        values = json.loads(path.read_text())
        focal = 0.5 * width / math.tan(0.5 * float(values["camera_angle_x"]))
        poses = [(str(f["file_path"]), np.array(f["transform_matrix"])) for f in values["frames"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            str(path), "is no transforms file of a synthetic scene", _REMEDY
        ) from error
    if any(pose.shape != (4, 4) or not np.isfinite(pose).all() for _, pose in poses):
        raise InputError(str(path), "has a pose that is not 4x4 finite numbers", _REMEDY)
    return [
        Camera(
            name.removeprefix("./"), width, height, focal, focal, width / 2, height / 2,
            (pose @ _FLIP)[:3].astype(np.float64),
        )
        for name, pose in poses
    ]  # fmt: skip


def read_rgba(path: Path) -> Float[np.ndarray, "height width 4"]:
    """Returns an image and its alpha as float32 in [0, 1], colours not multiplied by alpha.

    Raises:
        InputError: It cannot be read, or has no alpha.
    """
    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.ndim != 3 or pixels.shape[2] != 4 or pixels.dtype != np.uint8:
        raise InputError(str(path), "is not an image of 8 bits with alpha", _REMEDY)
    rgba = cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGBA)
    return np.asarray(rgba / np.float32(255), dtype=np.float32)


def on_white(rgba: Float[np.ndarray, "height width 4"]) -> Float[np.ndarray, "height width 3"]:
    """Returns the image before white: alpha x colour + 1 - alpha."""
    alpha = rgba[..., 3:]
    return np.asarray(alpha * rgba[..., :3] + (1 - alpha), dtype=np.float32)
