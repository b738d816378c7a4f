"""The strategies that the paper compares with: they fit the whole field, or a new one (section 5).

S2 goes on fitting a field to the stylized views, density and all; S1 fits a new one to them alone.
The views disagree about where the strokes are, and a free density invents shapes that explain it.
"""

from dataclasses import replace

from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField, set_occupancy
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.trainer import FieldTrainer
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.stylization.adaptation import AdaptationCurvePoint


def fit_new_field(
    stylized: TrainingViews,
    volume: FieldVolume,
    config: FieldTrainingConfig,
    kernels: Kernels,
    progress: Progress = silent,
) -> tuple[RadianceField, list[AdaptationCurvePoint]]:
    """Returns a field fitted to the stylized views alone (S1), and its curve.

    The fit has all of its iterations, whatever `config.early_gain_db`: painted views disagree, so
    that one set aside says little.
    """
    whole = replace(config, early_gain_db=0.0)
    field, curve = train_field(stylized, volume, whole, kernels, progress)
    return field, [AdaptationCurvePoint(p.iteration, p.seconds, p.psnr) for p in curve]


def finetune_all(
    field: RadianceField,
    stylized: TrainingViews,
    space: Space,
    config: FieldTrainingConfig,
    kernels: Kernels,
    progress: Progress = silent,
) -> tuple[RadianceField, list[AdaptationCurvePoint]]:
    """Returns the field with all of it fitted on, to the stylized views (S2), and its curve.

    The given field stays as it is. `config` is that of a fit, but the result has the size of the
    given field, and its lattice does not grow or shrink; the fit has all of its iterations. So
    `field`, `upsample_at`, `shrink_rise` and `early_gain_db` do not count.
    """
    config = replace(config, field=field.config, upsample_at=(), shrink_rise=0.0, early_gain_db=0.0)
    volume = FieldVolume(space.within(field.bounds), field.resolution)
    trainer = FieldTrainer(stylized, volume, config, kernels)
    set_occupancy(trainer.field.density, field.density.occupancy.clone())
    trainer.field.load_state_dict(field.state_dict())
    while trainer.state.iteration < config.iterations:
        psnr = trainer.step()
        progress(trainer.state.iteration, config.iterations, psnr=psnr)
    trainer.finish()
    trainer.field.bounds = field.bounds
    curve = [AdaptationCurvePoint(p.iteration, p.seconds, p.psnr) for p in trainer.state.curve]
    return trainer.field, curve
