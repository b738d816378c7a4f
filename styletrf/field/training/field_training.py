"""The fit of a radiance field to photographs (TensoRF section 4), from beginning to end.

`styletrf.field.training.trainer` holds the iterations. This file saves the state while they run,
and compresses the field that they end with.
"""

import logging
import time
from pathlib import Path

from styletrf.field.compression import compress
from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField
from styletrf.field.training.checkpoint import FieldCurvePoint, save_fit
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.trainer import FieldTrainer
from styletrf.finiteness import parameter_stages
from styletrf.progress import Progress, silent

_LOGGER = logging.getLogger(__name__)


def train_field(
    views: TrainingViews,
    volume: FieldVolume,
    config: FieldTrainingConfig,
    kernels: Kernels,
    progress: Progress = silent,
    checkpoint_dir: Path | None = None,
) -> tuple[RadianceField, list[FieldCurvePoint]]:
    """Returns the field that fills the volume and is fitted to the views, and its training curve.

    With a `checkpoint_dir`, the state is saved there about once a minute. A later call with the
    same arguments continues from it, to the same parameters up to the rounding of sums; a fit of
    other views or settings needs another folder.
    The fit is shorter where its validation views no longer improve, and longer where they improve
    fast (`styletrf.field.training.validation_views`).

    Raises:
        NotFiniteError: A tensor is not finite; the error names the first one. The state is then
            in `checkpoint_dir/not_finite`.
    """
    trainer = FieldTrainer(views, volume, config, kernels, checkpoint_dir)
    saved = time.monotonic()
    while trainer.state.iteration < trainer.state.end:
        psnr = trainer.step()
        if checkpoint_dir is not None and time.monotonic() - saved > config.checkpoint_seconds:
            trainer.require_finite(parameter_stages(trainer.field, trainer.optimizer))
            save_fit(checkpoint_dir, trainer)
            saved = time.monotonic()
        progress(trainer.state.iteration, trainer.state.end, psnr=psnr)
    trainer.finish()
    if config.shrink_rise > 0:
        compression = compress(trainer.field, trainer.loss, config.shrink_rise)
        _LOGGER.info("compressed: %s", compression)
    return trainer.field, trainer.state.curve
