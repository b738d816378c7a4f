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
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.observed_depths import observed_depths
from styletrf.field.training.view_exposures import view_exposures
from styletrf.files.tables import write_curve
from styletrf.scene.free_space import free_space
from styletrf.scene.scene_model import read_scene_model
from styletrf.scene.training_photographs import read_training_photographs
from styletrf.steps.step_run import StepRun


def fit_field(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes `density.safetensors`, `appearance.safetensors`, `field.json` and `curve.parquet`.

    Args:
        inputs: `poses` and `model`.
        out: The folder to fill.
        settings: Those of `FieldTrainingConfig`.
        run: Its progress is the iteration and the PSNR.
    """
    device = device_named(run.device_name)
    model = read_scene_model(inputs["model"] / "scene.json")
    photographs = read_training_photographs(inputs["poses"])
    fitted, points = photographs.cameras, photographs.points
    cameras = model.normalized(fitted)
    images = load_views(photographs.folder, cameras, device)
    depths = observed_depths(model, fitted, points, photographs.images(), photographs.masks())
    free = torch.from_numpy(free_space(model, fitted, points))
    field, curve = train_field(
        TrainingViews(cameras, images, depths, view_exposures(fitted, model.exposures, device)),
        FieldVolume(model.space, model.resolution, free),
        configured(FieldTrainingConfig, {"field.shading": model.shading, **settings}),
        kernels_for(device),
        run.progress,
        run.work,
    )
    save_field(out, field)
    write_curve(out / "curve.parquet", curve)
