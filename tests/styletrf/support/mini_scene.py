"""A scene for tests: a painted plane seen by a few small cameras, with its exact colors."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from shared_results import made_once
from torch import Tensor

from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.files.images import from_integers, write_rgb
from styletrf.geometry.cameras import Camera, pixel_centers
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from styletrf.scene.training_photographs import TrainingPhotographs
from styletrf.trajectory.trajectories import look_at

KERNELS = kernels_for(torch.device("cpu"))
SIZE = 20
MINI_FIT = FieldTrainingConfig(
    tv_views=1,
    field=FieldConfig((4, 2, 2), (4, 2, 2), features=8, hidden=16),
    iterations=120,
    rate_decay=0.1,  # so few iterations take larger steps
    batch=256,
    initial_voxels=10**3,
    upsample_at=(1 / 3, 2 / 3),
    batch_samples=8000,
    occupancy_every=20,
    shrink_rise=0.0,
)
"""A fit of the scene in seconds."""


@dataclass(frozen=True)
class MiniScene:
    cameras: list[Camera]
    images: Tensor
    model: SceneModel

    def views(self, **more) -> TrainingViews:
        return TrainingViews(self.cameras, self.images, **more)

    @property
    def volume(self) -> FieldVolume:
        return FieldVolume(self.model.space, self.model.resolution)


def painted_plane(n_views: int = 6) -> MiniScene:
    """A plane at depth 4 whose color varies smoothly."""
    rng = np.random.default_rng(0)
    target, down = np.array([0.0, 0.0, 4.0]), np.array([0.0, 1.0, 0.0])
    centers = np.column_stack([rng.uniform(-0.4, 0.4, (n_views, 2)), np.zeros(n_views)])
    cameras, images = [], []
    for k, center in enumerate(centers):
        pose = look_at(center, target, down)
        half = SIZE / 2
        cameras.append(Camera(f"{k}", SIZE, SIZE, float(SIZE), float(SIZE), half, half, pose))
        x, y = ((pixel_centers(SIZE, SIZE) - half) / SIZE).T
        directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ pose[:, :3].T
        plane = center + (4 / directions[:, 2])[:, None] * directions
        color = 0.5 + 0.4 * np.sin(2 * plane + np.array([0.0, 1.0, 2.0]))
        images.append(np.round(255 * color).astype(np.uint8).reshape(SIZE, SIZE, 3))
    points = np.column_stack([rng.uniform(-2, 2, (200, 2)), rng.uniform(3.5, 4.5, 200)])
    config = SceneModelConfig(image_long_side=SIZE, max_voxels=20**3)
    model = decide_scene_model(cameras, points, config)
    return MiniScene(model.normalized(cameras), torch.from_numpy(np.stack(images)), model)


def fit(scene: MiniScene, config=MINI_FIT, kernels=KERNELS, depths=None, **more) -> RadianceField:
    """The field of the scene, by the CPU's kernels; `more` goes to `train_field`."""
    field, _ = train_field(scene.views(depths=depths), scene.volume, config, kernels, **more)
    return field


def fitted_plane() -> RadianceField:
    """The field of the plane by `MINI_FIT`, made once in a run; each call returns a copy."""
    return made_once("field of the painted plane", lambda: fit(painted_plane()))


def photographs_of(scene: MiniScene, folder: Path) -> tuple[TrainingPhotographs, SceneModel]:
    """Returns the scene as photographs on disk, with 30 points, and the model of that world."""
    (folder / "images").mkdir(exist_ok=True)
    for camera, image in zip(scene.cameras, scene.images.numpy(), strict=True):
        write_rgb(folder / "images" / f"{camera.name}.png", from_integers(image))
    xyz = np.random.default_rng(0).uniform(-1, 1, (30, 3))
    none = np.zeros(0, np.int64)
    points = SparsePoints(
        xyz, np.zeros((30, 3), np.uint8), np.zeros(30), none, none, np.zeros((0, 2))
    )
    model = replace(scene.model, normalized_from_world=np.eye(4))
    return TrainingPhotographs(folder / "images", scene.cameras, points), model
