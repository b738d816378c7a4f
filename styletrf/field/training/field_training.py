"""The fit of a radiance field to photographs (TensoRF section 4), from beginning to end.

`styletrf.field.training.trainer` holds the iterations. This file saves the state while they run,
and compresses the field that they end with.
"""

import logging
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from jaxtyping import Bool
from torch import Tensor

from styletrf.capture.view_images import Image
from styletrf.field.compression import compress
from styletrf.field.kernels import Kernels
from styletrf.field.radiance_field import RadianceField
from styletrf.field.training.checkpoint import CurvePoint, save_fit
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.observed_depths import ObservedDepths
from styletrf.field.training.trainer import FieldTrainer
from styletrf.field.training.view_exposures import ViewExposures
from styletrf.finiteness import parameter_stages
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent

_LOGGER = logging.getLogger(__name__)


def train_field(
    cameras: Sequence[Camera],
    images: Iterable[Image],
    space: Space,
    resolution: tuple[int, int, int],
    config: FieldTrainingConfig,
    kernels: Kernels,
    progress: Progress = silent,
    checkpoint_dir: Path | None = None,
    free: Bool[Tensor, "cells cells cells"] | None = None,
    depths: ObservedDepths | None = None,
    exposures: ViewExposures | None = None,
) -> tuple[RadianceField, list[CurvePoint]]:
    """Returns the field fitted to the images, and its training curve.

    With a `checkpoint_dir`, the state is saved there about once a minute. A later call with the
    same arguments continues from it, to the same parameters up to the rounding of sums.
    The fit is shorter where its validation views no longer improve, and longer where they improve
    fast (`styletrf.field.training.validation_views`). The cells of the grid that are
    `free` get no density (`styletrf.scene.free_space`). The rays of pixels with `depths` end there
    (`styletrf.field.training.observed_depths`). Views may have `exposures` of their own
    (`styletrf.field.training.view_exposures`).

    Raises:
        NotFiniteError: A tensor is not finite; the error names the first one. The state is then
            in `checkpoint_dir/not_finite`.
    """
    trainer = FieldTrainer(
        cameras, images, space, resolution, config, kernels, checkpoint_dir, free, depths, exposures
    )
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
