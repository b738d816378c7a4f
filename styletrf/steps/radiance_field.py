"""The radiance field, fitted to the photographs that are not held out."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from styletrf.capture.views import load_views
from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import save_field
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.observed_depths import observed_depths
from styletrf.field.training.view_exposures import view_exposures
from styletrf.files.tables import write_curve
from styletrf.progress import Progress
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import read_scene_model
from styletrf.scene.training_photographs import read_training_photographs


def fit_field(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    device_name: str,
    progress: Progress,
    checkpoints: Path,
) -> None:
    """Writes `density.safetensors`, `appearance.safetensors`, `field.json` and `curve.parquet`.

    Args:
        inputs: `poses` and `model`.
        out: The folder to fill.
        settings: Of `FieldTrainingConfig`.
        device_name: `auto`, `cpu` or `cuda`.
        progress: Called with the iteration and the PSNR.
        checkpoints: A folder from which an interrupted fit continues.
    """
    device = device_named(device_name)
    model = read_scene_model(inputs["model"] / "scene.json")
    photographs = read_training_photographs(inputs["poses"])
    fitted, points = photographs.cameras, photographs.points
    cameras = model.normalized(fitted)
    field, curve = train_field(
        cameras,
        load_views(photographs.folder, cameras, device),
        model.space,
        model.resolution,
        configured(FieldTrainingConfig, {"field.shading": model.shading, **settings}),
        kernels_for(device),
        progress,
        checkpoints,
        torch.from_numpy(free_space(model, fitted, points)),
        observed_depths(model, fitted, points, photographs.images(), photographs.masks()),
        view_exposures(fitted, model.exposures, device),
    )
    save_field(out, field)
    write_curve(out / "curve.parquet", curve)
