"""Training of the style network: one pass over content photographs per style (Johnson et al. 2016).

A training can be killed at any moment and goes on from its last checkpoint: batch k depends on the
seed and k alone, and a checkpoint holds all that changes: network, Adam's moments and curve.
"""

import copy
import math
import time
from contextlib import closing
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from styletrf.content_batches import content_batches, read_content
from styletrf.errors import InputError
from styletrf.perceptual_loss import (
    PerceptualLossConfig,
    PerceptualTerms,
    perceptual_loss,
    style_grams,
)
from styletrf.progress import Progress, silent
from styletrf.style_checkpoint import CurveRow, Training, read_checkpoint, write_checkpoint
from styletrf.style_network import StyleNetwork, StyleNetworkConfig
from styletrf.vgg import VGG16


@dataclass(frozen=True, slots=True)
class StyleTrainingConfig:
    """How a style network is trained."""

    network: StyleNetworkConfig = field(default_factory=StyleNetworkConfig)
    loss: PerceptualLossConfig = field(default_factory=PerceptualLossConfig)
    iterations: int = 2000
    identity_iterations: int = 150  # of these the first, which learn to repeat the photograph
    batch: int = 4
    crop_px: int = 256
    style_px: int = 288  # shorter side of the style image: the smaller, the finer the strokes
    learning_rate: float = 2e-3  # Adam's
    final_learning_rate: float = 3e-4  # reached geometrically
    bfloat16: bool = True  # convolutions in bfloat16 where the hardware computes in it
    seed: int = 0


def train_style_network(
    config: StyleTrainingConfig,
    vgg: VGG16,
    style: Float[Tensor, "height width 3"],
    content_folder: Path,
    *,
    checkpoint_folder: Path,
    progress: Progress = silent,
    checkpoint_s: float = 30.0,
) -> tuple[StyleNetwork, list[CurveRow]]:
    """Returns the trained network and the loss of every iteration.

    Args:
        config: How to train.
        vgg: The perceptual network, in float32; its device is where the training runs.
        style: The painting, RGB in [0, 1].
        content_folder: Shards from `write_content_images`.
        checkpoint_folder: An existing folder that belongs to these very inputs; a checkpoint
            found there is continued.
        progress: Told the iteration and the loss.
        checkpoint_s: Seconds between checkpoints.

    Raises:
        InputError: A term of the loss is no longer finite, or there are no content images.
    """
    path = checkpoint_folder / "style_training.safetensors"
    training = _begin(config, vgg.mean.device)
    read_checkpoint(path, training)
    step = _Step(config, vgg, style)
    start = len(training.curve)
    batches = content_batches(
        read_content(content_folder),
        batch=config.batch,
        size_px=config.crop_px,
        seed=config.seed,
        start=start,
    )
    begun, saved = time.monotonic() - training.seconds, time.monotonic()
    with closing(batches):
        for k, content in enumerate(islice(batches, config.iterations - start), start):
            terms = step(training, k, content)
            row = _row(k, terms, time.monotonic() - begun)
            training.curve.append(row)
            progress(k + 1, config.iterations, loss=row.loss)
            if time.monotonic() - saved >= checkpoint_s:
                write_checkpoint(path, training)
                saved = time.monotonic()
    write_checkpoint(path, training)
    return training.network.eval(), training.curve


def computes_in_bfloat16(device: torch.device) -> bool:
    """Tells whether the hardware multiplies bfloat16 itself; emulation is slower than float32."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    capabilities = torch.cpu.get_capabilities()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16"))


def _begin(config: StyleTrainingConfig, device: torch.device) -> Training:
    generator = torch.Generator().manual_seed(config.seed)
    network = StyleNetwork(config.network, generator).to(device).train()
    return Training(network, torch.optim.Adam(network.parameters(), lr=config.learning_rate))


class _Step:
    """One iteration, with what stays the same through all of them: the style's Gram matrices."""

    def __init__(
        self, config: StyleTrainingConfig, vgg: VGG16, style: Float[Tensor, "height width 3"]
    ) -> None:
        self._device = vgg.mean.device
        self._fast = config.bfloat16 and computes_in_bfloat16(self._device)
        self._vgg = copy.deepcopy(vgg).to(torch.bfloat16) if self._fast else vgg
        self._config = config
        self._grams = style_grams(self._vgg, _shrunk(style.to(self._device), config.style_px))

    def __call__(self, training: Training, k: int, content: Tensor) -> PerceptualTerms:
        content = content.to(self._device)
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._fast):
            output = training.network(content)
        terms = self._terms(k, output.float(), content)
        _check_finite(terms, k)
        training.optimizer.zero_grad()
        terms.total.backward()
        for group in training.optimizer.param_groups:
            group["lr"] = _learning_rate(self._config, k)
        training.optimizer.step()
        return terms

    def _terms(self, k: int, output: Tensor, content: Tensor) -> PerceptualTerms:
        """The loss; at first that of an autoencoder (as Chen et al. 2018, CartoonGAN, begin).

        From random weights the network would first fall into flat grey, where the gradient of a
        Gram matrix vanishes, and spend hundreds of iterations there.
        """
        if k >= self._config.identity_iterations:
            return perceptual_loss(self._vgg, output, content, self._grams, self._config.loss)
        none = torch.zeros((), device=output.device)
        return PerceptualTerms(functional.mse_loss(output, content), none, none)


def _learning_rate(config: StyleTrainingConfig, k: int) -> float:
    ratio = config.final_learning_rate / config.learning_rate
    return float(config.learning_rate * ratio ** (k / config.iterations))


def _shrunk(style: Float[Tensor, "height width 3"], short_side_px: int) -> Float[Tensor, "1 3 _ _"]:
    """Reduces the painting, low-pass filtered, so that its shorter side is at most this long."""
    image = style.permute(2, 0, 1)[None]
    scale = min(1.0, short_side_px / min(style.shape[:2]))
    size = [max(1, round(side * scale)) for side in style.shape[:2]]
    return functional.interpolate(image, size=size, mode="bilinear", antialias=True)


def _check_finite(terms: PerceptualTerms, k: int) -> None:
    for name in ("content", "style", "tv"):
        value = float(getattr(terms, name).detach())
        if not math.isfinite(value):
            raise InputError(
                "style training",
                f"the {name} term became {value} in iteration {k + 1}",
                "Lower the learning rate, such as by --StyleNetwork-settings"
                """ '{"learning_rate": 5e-4, "final_learning_rate": 1e-4}', and run it again""",
            )


def _row(k: int, terms: PerceptualTerms, seconds: float) -> CurveRow:
    loss, content, style, tv = torch.stack(
        [terms.total, terms.content, terms.style, terms.tv]
    ).tolist()
    return CurveRow(k + 1, loss, content, style, tv, seconds)
