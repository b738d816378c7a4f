"""Scenes as the pipeline has them before the fit: what a field is fitted to and judged by."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import luigi
import torch
from task_of import task_of
from torch import Tensor

from pipeline.task import artifact
from styletrf.capture.views import load_views
from styletrf.field.training.observed_depths import ObservedDepths, observed_depths
from styletrf.geometry.camera_table import read_split
from styletrf.geometry.cameras import Camera
from styletrf.scene.explained_pixels import explained_pixels
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from styletrf.scene.training_photographs import read_training_photographs
from tasks.stages.scene import CameraPoses


@dataclass(frozen=True)
class Views:
    """Cameras in the normalized world with their images, uint8."""

    cameras: Sequence[Camera]
    images: Sequence[Tensor]


@dataclass(frozen=True)
class GivenScene:
    """A scene's model, what it is fitted to and what it is judged by."""

    model: SceneModel
    train: Views
    test: Views
    free: Tensor
    depths: ObservedDepths


def load_given_scene(name: str, config: SceneModelConfig) -> GivenScene:
    """Returns a scene of the data folder; its poses are taken from the store or made there."""
    poses = task_of(CameraPoses, scene=name, quality="draft")
    if not luigi.build([poses], local_scheduler=True, log_level="WARNING"):
        raise SystemExit(f"{name} has no poses")
    folder = artifact(poses)
    photographs = read_training_photographs(folder)
    fitted, points = photographs.cameras, photographs.points
    explained = explained_pixels(photographs.images(), fitted, points, photographs.masks())
    model = decide_scene_model(fitted, points.xyz_world, config, explained=explained)
    split = read_split(folder / "cameras.parquet")
    train, test = (_views(model, folder, part) for part in split)
    free = torch.from_numpy(free_space(model, fitted, points))
    depths = observed_depths(model, fitted, points, photographs.images(), photographs.masks())
    return GivenScene(model, train, test, free, depths)


def _views(model: SceneModel, folder: Path, cameras: Sequence[Camera]) -> Views:
    normalized = model.normalized(cameras)
    return Views(normalized, load_views(folder / "images", normalized))
