"""Predicts the cost of a fit on this machine from a few of its iterations at the final size.

The occupancy that a fit finds is not known yet; the sparse points stand for it, with the voxels
about them.
"""

import resource
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn import functional

from styletrf.capture.views import load_views
from styletrf.field.kernels import Kernels
from styletrf.field.occupancy import non_empty, voxels_along
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.trainer import FieldTrainer
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import SceneModel
from styletrf.scene.training_photographs import TrainingPhotographs

_ITERATIONS = 5
_NEIGHBORHOOD = 7  # voxels about a point that may be occupied


@dataclass(frozen=True, slots=True)
class FieldCost:
    """Seconds of a fit as long as planned, and the largest memory of this process so far."""

    seconds: float
    peak_memory_bytes: int
    voxels: int


def field_cost(
    model: SceneModel,
    photographs: TrainingPhotographs,
    config: FieldTrainingConfig,
    kernels: Kernels,
    device: torch.device,
) -> FieldCost:
    """Returns the cost of fitting the model; discards the iterations that it measures."""
    brief = replace(config, upsample_at=(), occupancy_every=1 << 30, early_gain_db=0.0)
    cameras = model.normalized(photographs.cameras)
    images = load_views(photographs.folder, cameras, device)
    views, volume = TrainingViews(cameras, images), FieldVolume(model.space, model.resolution)
    trainer = FieldTrainer(views, volume, brief, kernels)
    points = transformed(model.normalized_from_world, photographs.points.xyz_world)
    occupied = voxels_about(model.space.to_grid(points), model.resolution)
    trainer.field.density.occupancy = occupied.to(trainer.images.device)
    trainer.step()  # compiles
    if config.average_share:
        trainer.average.add(trainer.field)  # takes its memory
    seconds = []
    for _ in range(_ITERATIONS):
        started = time.monotonic()
        trainer.step()
        seconds.append(time.monotonic() - started)
    return FieldCost(
        statistics.median(seconds) * config.iterations,
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10,
        int(np.prod(model.resolution)),
    )


def voxels_about(
    points_grid: Float[np.ndarray, "points 3"], resolution: Sequence[int]
) -> UInt8[Tensor, "x y z"]:
    """Returns the occupancy that has the voxels near the points."""
    shape = voxels_along(resolution)
    inside = points_grid[(np.abs(points_grid) <= 1).all(axis=1)]
    cell = ((inside + 1) / 2 * shape).astype(np.int64).clip(max=np.array(shape) - 1)
    occupied = torch.zeros(shape)
    occupied[tuple(torch.from_numpy(cell.T))] = 1
    spread = functional.max_pool3d(
        occupied[None, None], _NEIGHBORHOOD, stride=1, padding=_NEIGHBORHOOD // 2
    )[0, 0]
    return non_empty(spread > 0)
