"""A scene's photographs as tensors, and which of them are held out."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import torch
from jaxtyping import UInt8
from torch import Tensor

from styletrf.cameras import Camera
from styletrf.given_poses import GivenView
from styletrf.images import read_rgb, to_integers

CPU = torch.device("cpu")
HOLD_OUT_EVERY = 8  # LLFF's protocol: views 0, 8, 16, ... of the sorted names


def load_views(
    folder: Path, cameras: Sequence[Camera], device: torch.device = CPU
) -> list[UInt8[Tensor, "height width 3"]]:
    """Returns the cameras' images from `folder`, reduced to each camera's size by pixel area."""
    views = []
    for camera in cameras:
        image = read_rgb(folder / f"{camera.name}.png")
        size = (camera.width, camera.height)
        if image.shape[1::-1] != size:
            image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        views.append(torch.from_numpy(to_integers(image)).to(device))
    return views


def held_out_names(cameras: Sequence[Camera], given: Mapping[str, GivenView]) -> set[str]:
    """Returns the names of the views to measure by: those of a published split, or every eighth."""
    if any(view.held_out for view in given.values()):
        return {camera.name for camera in cameras if given[camera.name].held_out}
    return {cameras[k].name for k in split_views(len(cameras))[1]}


def split_views(n_views: int) -> tuple[list[int], list[int]]:
    """Returns the indices of the training views and of the views held out, every eighth."""
    held_out = list(range(0, n_views, HOLD_OUT_EVERY))
    return [k for k in range(n_views) if k % HOLD_OUT_EVERY], held_out
