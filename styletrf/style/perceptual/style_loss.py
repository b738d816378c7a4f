"""The distance of a picture from one painting's style and from its own content."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.finiteness import Named
from styletrf.style.perceptual.perceptual_loss import (
    PerceptualLossConfig,
    PerceptualTerms,
    StyleTerm,
    content_features,
    gram_term,
    perceptual_terms,
    style_grams,
)
from styletrf.style.perceptual.predictor_features import predictor_moments, predictor_term
from styletrf.style.perceptual.sliced_features import sliced_term, style_columns
from styletrf.style.perceptual.vgg import VGG16
from styletrf.style.transfer.style_predictor import StylePredictor

Statistics = Literal["sliced", "gram"]


class StyleLoss:
    """The perceptual loss of one painting, whose features are computed once."""

    def __init__(
        self,
        vgg: VGG16,
        painting: Float[Tensor, "1 3 height width"],
        config: PerceptualLossConfig,
        statistics: Statistics,
        predictor: StylePredictor | None = None,
        predictor_weight: float = 1.0,
    ) -> None:
        """Computes the features of the painting.

        Args:
            vgg: The perceptual network; features have its dtype.
            painting: RGB in [0, 1], of the size at which its strokes count.
            config: The weights of the terms.
            statistics: The statistics of the perceptual network's features that are compared.
            predictor: Also looks at the style; its weights stay as they are.
            predictor_weight: The weight of its term; at 0 it is not used.
        """
        self._vgg, self._config, self._statistics = vgg, config, statistics
        targets = style_grams if statistics == "gram" else style_columns
        self._targets = targets(vgg, painting)
        self._predictor = predictor if predictor_weight > 0 else None
        self._predictor_weight = predictor_weight
        self._moments = predictor_moments(self._predictor, painting) if self._predictor else []

    def content_features(
        self, shown: Float[Tensor, "batch 3 height width"]
    ) -> Float[Tensor, "batch channels _ _"]:
        """Returns the features that an output should share with its content, RGB in [0, 1]."""
        return content_features(self._vgg, shown, self._config)

    def __call__(
        self,
        output: Float[Tensor, "batch 3 height width"],
        content: Float[Tensor, "batch channels _ _"],
        generator: torch.Generator,
    ) -> PerceptualTerms:
        """Returns the weighted terms, differentiable in the output.

        Args:
            output: The painted picture, RGB; values may leave [0, 1].
            content: The `content_features` of the unpainted picture.
            generator: Draws the features that are compared; on the CPU.
        """
        config = self._config
        terms = perceptual_terms(self._vgg, output, content, self._style_term(generator), config)
        if self._predictor is None:
            return terms
        seen = predictor_term(self._predictor, self._moments, output, generator)
        return replace(terms, style=terms.style + self._predictor_weight * seen)

    def targets(self) -> Iterator[Named]:
        """Yields the painting's statistics by name."""
        for layer, target in self._targets.items():
            yield f"the style's statistics of {layer}", target
        yield from (("the predictor's statistics", moments.second) for moments in self._moments)

    def _style_term(self, generator: torch.Generator) -> StyleTerm:
        if self._statistics == "gram":
            return partial(gram_term, self._targets, self._config)
        return partial(sliced_term, self._targets, self._config.style_layers, generator)
