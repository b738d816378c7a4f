"""Scenes as the pipeline has them before the fit: what a field is fitted to and judged by."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import luigi
import torch
from torch import Tensor

from pipeline.task import artifact
from styletrf.capture.masks import mask_of_view
from styletrf.capture.views import load_views
from styletrf.field.training.sparse_depth import SparseDepths, sparse_depths
from styletrf.files.images import read_rgb
from styletrf.geometry.camera_table import read_cameras, read_fitted_rows, read_split
from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import read_points
from styletrf.scene.explained_pixels import explained_pixels
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from tasks.scene import CameraPoses


@dataclass(frozen=True)
class Views:
    """Cameras in the normalised world with their images, uint8."""

    cameras: Sequence[Camera]
    images: Sequence[Tensor]


@dataclass(frozen=True)
class GivenScene:
    """A scene's model, what it is fitted to and what it is judged by."""

    model: SceneModel
    train: Views
    test: Views
    free: Tensor
    depths: SparseDepths


def load_given_scene(name: str, config: SceneModelConfig) -> GivenScene:
    """Returns a scene of the data folder; its poses are taken from the store or made there."""
    poses = CameraPoses(scene=name, quality="draft")
    if not luigi.build([poses], local_scheduler=True, log_level="WARNING"):
        raise SystemExit(f"{name} has no poses")
    folder = artifact(poses)
    table = folder / "cameras.parquet"
    cameras, points = read_cameras(table), read_points(folder / "points.parquet")
    images = (read_rgb(folder / "images" / f"{camera.name}.png") for camera in cameras)
    masks = (mask_of_view(folder / "images", camera.name) for camera in cameras)
    explained = explained_pixels(images, cameras, points, masks)
    model = decide_scene_model(cameras, points.xyz_world, config, explained=explained)
    fitted = read_split(table)[0]
    train, test = (_views(model, folder, part) for part in read_split(table))
    observed = points.of_images(read_fitted_rows(table))
    free = torch.from_numpy(free_space(model, fitted, observed))
    return GivenScene(model, train, test, free, sparse_depths(model, fitted, observed))


def _views(model: SceneModel, folder: Path, cameras: Sequence[Camera]) -> Views:
    normalized = model.normalized(cameras)
    return Views(normalized, load_views(folder / "images", normalized))
