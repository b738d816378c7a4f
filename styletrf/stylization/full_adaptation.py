"""The strategies that the paper compares with: all of the field free, or a new one (section 5).

S2 goes on fitting a field to the stylized views, density and all; S1 fits a new one to them alone.
The views disagree about where the strokes are, and a free density invents shapes that explain it.
"""

from collections.abc import Sequence
from dataclasses import replace

from jaxtyping import Bool, UInt8
from torch import Tensor

from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField, set_occupancy
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.trainer import FieldTrainer
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.stylization.adaptation import AdaptationPoint


def fit_new_field(
    cameras: Sequence[Camera],
    stylized: UInt8[Tensor, "views height width 3"],
    space: Space,
    resolution: tuple[int, int, int],
    config: FieldTrainingConfig,
    kernels: Kernels,
    progress: Progress = silent,
    free: Bool[Tensor, "cells cells cells"] | None = None,
) -> tuple[RadianceField, list[AdaptationPoint]]:
    """Returns a field fitted to the stylized views alone (S1), and its curve.

    Its density stays out of the cells that are `free`, as that of the photographs' field does. It
    has all of its iterations: painted views disagree, so that one set aside says little.
    """
    whole = replace(config, early_gain_db=0.0)
    field, curve = train_field(
        cameras, stylized, space, resolution, whole, kernels, progress, free=free
    )
    return field, [AdaptationPoint(p.iteration, p.seconds, p.psnr) for p in curve]


def finetune_all(
    field: RadianceField,
    cameras: Sequence[Camera],
    stylized: UInt8[Tensor, "views height width 3"],
    space: Space,
    config: FieldTrainingConfig,
    kernels: Kernels,
    progress: Progress = silent,
) -> tuple[RadianceField, list[AdaptationPoint]]:
    """Returns the field with all of it fitted on, to the stylized views (S2), and its curve.

    The given field stays as it is. `config` is that of a fit; its lattice does not grow.
    """
    config = replace(config, field=field.config, upsample_at=(), shrink_rise=0.0, early_gain_db=0.0)
    trainer = FieldTrainer(
        cameras, stylized, space.within(field.bounds), field.resolution, config, kernels
    )
    set_occupancy(trainer.field.density, field.density.occupancy.clone())
    trainer.field.load_state_dict(field.state_dict())
    while trainer.state.iteration < config.iterations:
        psnr = trainer.step()
        progress(trainer.state.iteration, config.iterations, psnr=psnr)
    trainer.finish()
    trainer.field.bounds = field.bounds
    curve = [AdaptationPoint(p.iteration, p.seconds, p.psnr) for p in trainer.state.curve]
    return trainer.field, curve
