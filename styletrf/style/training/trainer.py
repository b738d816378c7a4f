"""Training of the style network: one pass over content photographs per style (Johnson et al. 2016).

A training can be killed at any moment and goes on from its last checkpoint: batch k depends on the
seed and k alone, and a checkpoint holds all that changes: network, Adam's moments and curve.
"""

import logging
import time
from collections.abc import Callable
from contextlib import closing
from copy import deepcopy
from dataclasses import replace
from itertools import islice
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.content.content_batches import content_batches, read_content
from styletrf.finiteness import parameter_stages, require_finite
from styletrf.progress import Progress, silent
from styletrf.style.perceptual.painting_size import scale_warnings, scaled_painting
from styletrf.style.perceptual.perceptual_loss import PerceptualTerms
from styletrf.style.perceptual.vgg import VGG16
from styletrf.style.style_network import PaintingNetwork, StyleNetwork
from styletrf.style.style_survey import gram_trace_ratio, trace_warnings
from styletrf.style.training.checkpoint import (
    StyleCurvePoint,
    Training,
    new_training,
    read_checkpoint,
    write_checkpoint,
)
from styletrf.style.training.config import StyleTrainingConfig
from styletrf.style.training.data_parallel import Ranks
from styletrf.style.training.step import StyleStep
from styletrf.style.training.temporal_loss import ContentPair, TemporalLossConfig
from styletrf.style.transfer.network import TransferNetwork
from styletrf.style.transfer.style_predictor import StylePredictor

_LOGGER = logging.getLogger(__name__)


def train_style_network(
    config: StyleTrainingConfig,
    vgg: VGG16,
    style: Float[Tensor, "height width 3"],
    content_folder: Path,
    *,
    checkpoint_folder: Path,
    initial: TransferNetwork | None = None,
    predictor: StylePredictor | None = None,
    pairs: Callable[[int], ContentPair] | None = None,
    progress: Progress = silent,
    checkpoint_s: float = 30.0,
    ranks: Ranks | None = None,
) -> tuple[PaintingNetwork, list[StyleCurvePoint]]:
    """Returns the trained network and the loss of every iteration.

    Args:
        config: The settings of the training.
        vgg: The perceptual network, in float32; its device is where the training runs.
        style: The painting, RGB in [0, 1].
        content_folder: Shards from `write_content_images`.
        checkpoint_folder: An existing folder that belongs to these very inputs; a checkpoint
            found there is continued.
        initial: A network that paints already, of which a copy is trained; without it, Johnson's
            network begins from random weights.
        predictor: Compares styles beside the perceptual network; see `predictor_features`.
        pairs: Returns pairs of renders for the number of an iteration. The fraction
            `temporal_loss.renders` of the iterations with a temporal loss takes these.
        progress: Called with the iteration and the loss.
        checkpoint_s: Seconds between checkpoints.
        ranks: The processes that share each batch; the first reports, and writes checkpoints.

    Raises:
        InputError: A term of the loss is no longer finite, or there are no content images.
        NotFiniteError: A parameter of the network is no longer finite.
    """
    ranks = ranks or Ranks()
    training, config = begin(config, vgg.mean.device, initial)
    read_checkpoint(checkpoint_folder, training)
    step = StyleStep(config, vgg, style, initial, predictor, ranks)
    start, encoded = len(training.curve), read_content(content_folder)
    if start == 0 and ranks.is_first:
        _warn(config, vgg, style, encoded)
    sizes = {"batch": config.batch, "size_px": config.crop_px, "seed": config.seed}
    batches = content_batches(encoded, **sizes, start=start)
    begun, saved = time.monotonic() - training.seconds, time.monotonic()
    with closing(batches):
        for k, content in enumerate(islice(batches, config.iterations - start), start):
            is_paired = _is_paired(k, config.temporal_loss)
            terms = step(training, k, pairs(k) if pairs and is_paired else content)
            row = _row(k, terms, time.monotonic() - begun)
            training.curve.append(row)
            if ranks.is_first:
                progress(k + 1, config.iterations, loss=row.loss)
            if ranks.is_first and time.monotonic() - saved >= checkpoint_s:
                _save(checkpoint_folder, training)
                saved = time.monotonic()
    if ranks.is_first:
        _save(checkpoint_folder, training)
    return training.network.eval(), training.curve


def _save(folder: Path, training: Training) -> None:
    """Writes a checkpoint, which must be worth going on from."""
    left = parameter_stages(training.network, training.optimizer)
    require_finite("style training", f"at iteration {len(training.curve)}", left)
    write_checkpoint(folder, training)


def _warn(config: StyleTrainingConfig, vgg: VGG16, style: Tensor, encoded: list[bytes]) -> None:
    """Logs warnings about a painting that is likely to stylize poorly."""
    few = content_batches(encoded, batch=8, size_px=config.crop_px, seed=config.seed)
    with closing(few):
        content = next(few).to(vgg.mean.device)
    size = config.style_px, config.stroke_scale
    ratio = gram_trace_ratio(vgg, scaled_painting(style.to(vgg.mean.device), *size), content)
    for warning in [*scale_warnings(style.shape, *size), *trace_warnings(ratio)]:
        _LOGGER.warning(warning)


def _is_paired(k: int, config: TemporalLossConfig) -> bool:
    """Returns whether iteration `k` takes renders: a fraction of those with a temporal loss."""
    look, rest = divmod(k, config.every)
    return rest == 0 and int((look + 1) * config.renders) > int(look * config.renders)


def begin(
    config: StyleTrainingConfig, device: torch.device, initial: TransferNetwork | None = None
) -> tuple[Training, StyleTrainingConfig]:
    """Returns a training that has not begun, and its settings.

    A network that paints already needs no identity phase; one that does not has no colors to hold,
    and its identity phase takes at most a third of the iterations.
    """
    if initial is not None:
        network: PaintingNetwork = deepcopy(initial)
        config = replace(config, identity_iterations=0)
    else:
        network = StyleNetwork(config.network, torch.Generator().manual_seed(config.seed))
        identity = min(config.identity_iterations, config.iterations // 3)
        config = replace(
            config, identity_iterations=identity, color_weight=0.0, normalization_share=0.0
        )
    return new_training(network.to(device)), config


def _row(k: int, terms: PerceptualTerms, seconds: float) -> StyleCurvePoint:
    values = [terms.total, terms.content, terms.style, terms.tv, terms.temporal, terms.color]
    loss, content, style, tv, temporal, color = torch.stack(values).tolist()
    return StyleCurvePoint(k + 1, loss, content, style, tv, temporal, color, seconds)
