"""A loss of renders whose content weight falls as far as a level of lost content permits.

At one weight of the content term some paintings leave much of the scene: broad soft forms cost
little content, hard lines cost much. So the weight falls while a render keeps more than it has to,
and rises again to where it began, as the multiplier of the constraint x <= log(1 + level) does
(dual ascent, in its logarithm), x the term that each render has:

    weight <- weight exp(rate (x - log(1 + level))),

from `least_factor` times to once where it began. Above that it would take strokes away again.
"""

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from torch import Tensor

from styletrf.configuration import require_within
from styletrf.style.perceptual.perceptual_loss import PerceptualLossConfig, PerceptualTerms

_MAX_LOG_STEP = 1.0  # an iteration multiplies the weight by e at most


@dataclass(frozen=True, slots=True)
class ContentConstraintConfig:
    """The level to which content may be lost, and how fast its weight follows (0: not at all).

    The term is log(1 + d / t), `d` the mean squared difference between the features of a render and
    of the unstylized one, `t` the mean square of the latter's; the level is one of d / t.
    """

    level: float = 0.88
    rate: float = 0.8
    least_factor: float = 1 / 8

    def __post_init__(self) -> None:
        require_within("(0, inf)", self, "level")
        require_within("[0, inf)", self, "rate")
        require_within("(0, 1]", self, "least_factor")


@runtime_checkable
class TermsOfLoss(Protocol):
    """The weighted terms of a loss, as `StyleLoss` has them."""

    def content_features(self, shown: Tensor) -> Tensor:
        """Returns the features that an output should share with its content image."""

    def __call__(
        self, output: Tensor, content: Tensor, generator: torch.Generator
    ) -> PerceptualTerms:
        """Returns the terms, differentiable in the output."""


class ConstrainedContentLoss:
    """The sum of the terms of a loss; it is called once for each iteration, since calls count.

    The weight stays where the loss has no content term, or one that is not relative.
    """

    def __init__(
        self, terms: TermsOfLoss, loss: PerceptualLossConfig, config: ContentConstraintConfig
    ) -> None:
        """Begins with the weight of the loss.

        Args:
            terms: The terms of the loss.
            loss: The weights in these terms.
            config: The level, and how fast the weight follows.
        """
        self._terms, self._initial_weight, self._config = terms, loss.content_weight, config
        self._follows = loss.relative and loss.content_weight > 0
        self.factor = 1.0
        """The weight as a multiple of the weight that it began with."""

    def content_features(self, unstylized: Tensor) -> Tensor:
        """Returns the features that a render should share with the unstylized one."""
        return self._terms.content_features(unstylized)

    def __call__(self, image: Tensor, features: Tensor, generator: torch.Generator) -> Tensor:
        """Returns the loss of a render, and moves the weight of the content for the next."""
        terms = self._terms(image, features, generator)
        total = terms.total + (self.factor - 1) * terms.content
        if self._follows:
            self._follow(float(terms.content.detach()) / self._initial_weight)
        return total

    def _follow(self, found: float) -> None:
        config = self._config
        step = config.rate * (found - math.log1p(config.level))
        moved = self.factor * math.exp(max(-_MAX_LOG_STEP, min(step, _MAX_LOG_STEP)))
        self.factor = max(config.least_factor, min(moved, 1.0))
