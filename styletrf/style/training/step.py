"""One iteration of a style training: the painted images, their loss, and Adam's step."""

import copy
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from styletrf.devices import is_faster_in_bfloat16
from styletrf.errors import InputError
from styletrf.finiteness import Named, first_not_finite, parameter_stages
from styletrf.style.perceptual.painting_size import scaled_painting
from styletrf.style.perceptual.perceptual_loss import PerceptualTerms, color_drift, mean_terms
from styletrf.style.perceptual.style_loss import StyleLoss
from styletrf.style.perceptual.vgg import VGG16
from styletrf.style.style_network import PaintingNetwork
from styletrf.style.training.checkpoint import Training
from styletrf.style.training.config import StyleTrainingConfig
from styletrf.style.training.data_parallel import Ranks, map_on_cores
from styletrf.style.training.temporal_loss import ContentPair, jittered_pair, temporal_loss
from styletrf.style.transfer.network import TransferNetwork
from styletrf.style.transfer.style_predictor import StylePredictor

_COLOR_BLOCK_PX = 8


class StyleStep:
    """An iteration, with the statistics of one painting that stay the same through all."""

    def __init__(
        self,
        config: StyleTrainingConfig,
        vgg: VGG16,
        style: Float[Tensor, "height width 3"],
        initial: TransferNetwork | None = None,
        predictor: StylePredictor | None = None,
        ranks: Ranks | None = None,
    ) -> None:
        """Computes the statistics of the painting.

        Args:
            config: The settings of the training.
            vgg: The perceptual network, in float32; its device is where the training runs.
            style: RGB in [0, 1].
            initial: The network that the training began from, whose colors `config.color_weight`
                holds.
            predictor: Compares the style beside the perceptual network, by
                `config.predictor_weight`.
            ranks: The processes that share each batch.
        """
        self._ranks = ranks or Ranks()
        self._device = vgg.mean.device
        self._fast = config.bfloat16 and is_faster_in_bfloat16(self._device)
        self._config = config
        self._initial = initial.to(self._device).eval() if initial else None
        if predictor is not None:
            predictor = copy.deepcopy(predictor).requires_grad_(requires_grad=False)
            predictor.to(self._device)
        self._style_loss = StyleLoss(
            copy.deepcopy(vgg).to(torch.bfloat16) if self._fast else vgg,
            scaled_painting(style.to(self._device), config.style_px, config.stroke_scale),
            config.loss,
            config.statistics,
            predictor,
            config.predictor_weight,
        )

    def __call__(
        self, training: Training, k: int, content: Tensor | ContentPair
    ) -> PerceptualTerms:
        """Takes iteration `k` and returns the terms of its loss.

        Raises:
            InputError: A term is no longer finite; it names the first cause that is not, if there
                is one.
        """
        network = training.network
        content = self._jittered(k, self._shard(content))
        learned = [p for p in network.parameters() if p.requires_grad]

        def gradient(part: Tensor | ContentPair) -> tuple[PerceptualTerms, Sequence[Tensor | None]]:
            terms = self.terms(network, k, part)
            return terms, torch.autograd.grad(terms.total, learned, allow_unused=True)

        parts = map_on_cores(gradient, self._parts(content))
        terms = mean_terms([terms for terms, _ in parts])
        self._require_finite(terms, training, k, content)
        for parameter, *found in zip(learned, *(gradients for _, gradients in parts), strict=True):
            used = [g for g in found if g is not None]
            parameter.grad = torch.stack(used).sum(dim=0) / len(parts) if used else None
        self._ranks.average(p.grad for p in learned)
        for group in training.optimizer.param_groups:
            group["lr"] = _learning_rate(self._config, k, group["name"])
        training.optimizer.step()
        return terms

    def terms(
        self, network: PaintingNetwork, k: int, content: Tensor | ContentPair
    ) -> PerceptualTerms:
        """Returns the loss; from random weights, at first that of an autoencoder.

        (As Chen et al. 2018, CartoonGAN, begin.) Such a network would first fall into flat gray,
        where the gradient of a Gram matrix vanishes, and spend hundreds of iterations there.
        """
        config, content = self._config.temporal_loss, self._jittered(k, content)
        if not isinstance(content, ContentPair):
            painted = self._painted(network, content)
            return self._loss(k, painted, content)
        content = ContentPair(*(getattr(content, f).to(self._device) for f in content.__slots__))
        both = self._painted(network, torch.cat([content.first, content.second]))
        first, second = both.chunk(2)
        terms = self._loss(k, first, content.first)
        images = zip(first.split(1), second.split(1), _one_by_one(content), strict=True)
        temporal = torch.stack([temporal_loss(*image) for image in images]).mean()
        return replace(terms, temporal=config.every * config.weight * temporal)

    def _jittered(self, k: int, content: Tensor | ContentPair) -> Tensor | ContentPair:
        """Returns the images with moved copies, in iterations with a temporal loss."""
        config = self._config.temporal_loss
        if isinstance(content, ContentPair):
            return content
        content = content.to(self._device)
        if config.weight == 0 or k % config.every:
            return content
        seed = (self._config.seed << 32) + (self._ranks.rank << 24) + k
        return jittered_pair(content, config, torch.Generator().manual_seed(seed))

    def _parts(self, content: Tensor | ContentPair) -> Sequence[Tensor | ContentPair]:
        """Returns the images of a batch one by one on the CPU; a GPU computes them at once.

        The loss is the mean of the images' losses on either, so the number of cores does not change
        it.
        """
        if self._device.type != "cpu":
            return [content]
        if isinstance(content, Tensor):
            images: Sequence[Tensor] = content.split(1)
            return images
        return _one_by_one(content)

    def _shard(self, content: Tensor | ContentPair) -> Tensor | ContentPair:
        if isinstance(content, Tensor):
            return self._ranks.shard(content)
        return ContentPair(*(self._ranks.shard(getattr(content, f)) for f in content.__slots__))

    def _require_finite(
        self, terms: PerceptualTerms, training: Training, k: int, content: Tensor | ContentPair
    ) -> None:
        for name in ("content", "style", "tv", "temporal", "color"):
            value = float(getattr(terms, name).detach())
            if math.isfinite(value):
                continue
            cause = first_not_finite(self._causes(training, content))
            of = f", for {cause} is not finite" if cause else ""
            raise InputError(
                "style training",
                f"the {name} term became {value} in iteration {k + 1}{of}",
                "Lower the learning rate, such as by --StyleNetwork-settings"
                """ '{"learning_rate": 5e-4, "final_learning_rate": 1e-4}', and run it again""",
            )

    def _causes(self, training: Training, content: Tensor | ContentPair) -> Iterator[Named]:
        """Yields the causes of a loss: the batch, the style, and the results of past steps."""
        images = [content] if isinstance(content, Tensor) else [content.first, content.second]
        yield from (("a content image", image) for image in images)
        yield from self._style_loss.targets()
        yield from parameter_stages(training.network, training.optimizer)

    def _painted(self, network: PaintingNetwork, content: Tensor) -> Tensor:
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._fast):
            output: Tensor = network(content)
        return output.float()

    def _loss(self, k: int, output: Tensor, content: Tensor) -> PerceptualTerms:
        if k < self._config.identity_iterations:
            none = torch.zeros((), device=output.device)
            return PerceptualTerms(functional.mse_loss(output, content), none, none, none, none)
        seed = (self._config.seed << 32) + k
        loss = self._style_loss
        terms = mean_terms([
            loss(painted, loss.content_features(plain), torch.Generator().manual_seed(seed))
            for painted, plain in zip(output.split(1), content.split(1), strict=True)
        ])  # fmt: skip
        if self._initial is None or self._config.color_weight == 0:
            return terms
        with torch.no_grad():
            held = self._painted(self._initial, content)
        images = zip(output.split(1), held.split(1), strict=True)
        drift = torch.stack([color_drift(*image, _COLOR_BLOCK_PX) for image in images]).mean()
        return replace(terms, color=self._config.color_weight * drift)


def _one_by_one(pairs: ContentPair) -> list[ContentPair]:
    columns = [getattr(pairs, f).split(1) for f in pairs.__slots__]
    return [ContentPair(*row) for row in zip(*columns, strict=True)]


def _learning_rate(config: StyleTrainingConfig, k: int, group: str) -> float:
    ratio = config.final_learning_rate / config.learning_rate
    rate = float(config.learning_rate * ratio ** (k / config.iterations))
    if group == "normalization":
        return config.normalization_rate * rate
    return rate if k >= config.normalization_share * config.iterations else 0.0
