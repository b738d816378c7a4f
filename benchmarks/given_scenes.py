"""Scenes with given poses, below the folder that STYLETRF_DATA names: LLFF's and NeRF's."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from styletrf.blender_transforms import on_white, read_blender_cameras, read_rgba
from styletrf.cameras import Camera
from styletrf.images import read_rgb, to_integers
from styletrf.llff_poses import points_at_bounds, read_llff_poses
from styletrf.photographs import list_photographs
from styletrf.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from styletrf.views import load_views, split_views
from styletrf.visual_hull import extremes_of_hull


@dataclass(frozen=True)
class Views:
    """Cameras in the normalised world with their images, uint8."""

    cameras: Sequence[Camera]
    images: Tensor


@dataclass(frozen=True)
class GivenScene:
    """A scene's model, what it is fitted to and what it is judged by."""

    model: SceneModel
    train: Views
    test: Views


def load_given_scene(name: str, config: SceneModelConfig) -> GivenScene:
    """Returns a scene by its folder's name; `config.image_long_side` is the size worked at."""
    folder = Path(os.environ["STYLETRF_DATA"]) / "scenes" / name
    load = _load_llff if (folder / "poses_bounds.npy").exists() else _load_blender
    return load(folder, config)


def _load_llff(folder: Path, config: SceneModelConfig) -> GivenScene:
    files = list_photographs(folder / "images")
    height, width, _ = read_rgb(files[0]).shape
    poses = read_llff_poses(
        folder / "poses_bounds.npy", [file.stem for file in files], width, height
    )
    model = decide_scene_model(poses.cameras, points_at_bounds(poses), config)
    cameras = model.normalized(poses.cameras)
    images = load_views(folder / "images", cameras)
    train, test = split_views(len(cameras))
    return GivenScene(
        model,
        Views([cameras[k] for k in train], images[train]),
        Views([cameras[k] for k in test], images[test]),
    )


def _load_blender(folder: Path, config: SceneModelConfig) -> GivenScene:
    views = {part: _blender_views(folder, part) for part in ("train", "test")}
    cameras, rgba = views["train"]
    points = extremes_of_hull(cameras, [image[..., 3] > 0 for image in rgba])
    model = decide_scene_model(cameras, points, config)
    parts = {
        part: Views(
            model.normalized(cameras),
            torch.from_numpy(np.stack([to_integers(on_white(image)) for image in rgba])),
        )
        for part, (cameras, rgba) in views.items()
    }
    return GivenScene(model, parts["train"], parts["test"])


def _blender_views(folder: Path, part: str) -> tuple[list[Camera], list[np.ndarray]]:
    path = folder / f"transforms_{part}.json"
    first = next((folder / part).glob("*.png"))
    height, width, _ = read_rgba(first).shape
    cameras = read_blender_cameras(path, width, height)
    return cameras, [read_rgba(folder / f"{camera.name}.png") for camera in cameras]
