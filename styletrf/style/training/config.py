"""The settings of a style training."""

from dataclasses import dataclass, field, replace
from typing import TypeVar

from styletrf.configuration import SEEDS, require_at_least, require_within
from styletrf.style.gatys import GatysConfig
from styletrf.style.perceptual.perceptual_loss import PerceptualLossConfig
from styletrf.style.perceptual.style_loss import Statistics
from styletrf.style.residual_network import SMALLEST_PX
from styletrf.style.style_network import StyleNetworkConfig
from styletrf.style.training.temporal_loss import TemporalLossConfig


@dataclass(frozen=True, slots=True)
class StyleTrainingConfig:
    """Settings of the training of a style network.

    With `warm_start` the training begins with the network of arbitrary style transfer for the
    painting: at first only the normalizations learn, then all weights, and `color_weight` holds the
    colors that it began with. Without, Johnson's network begins from random weights.
    """

    network: StyleNetworkConfig = field(default_factory=StyleNetworkConfig)  # without a warm start
    loss: PerceptualLossConfig = field(default_factory=PerceptualLossConfig)
    statistics: Statistics = "sliced"  # of features, that make the style term
    predictor_weight: float = 1.0  # with a warm start: see `predictor_features`
    temporal_loss: TemporalLossConfig = field(default_factory=TemporalLossConfig)
    iterations: int = 2000
    warm_start: bool = True
    normalization_share: float = 0.2  # of the iterations, in which only normalizations learn
    normalization_rate: float = 10.0  # times the learning rate of the other weights
    color_weight: float = 2.0
    identity_iterations: int = 150  # without a warm start the first repeat the photograph
    batch: int = 4
    crop_px: int = 256
    style_px: int = 288  # shorter side of the style image: the smaller, the finer the strokes
    stroke_scale: float = 1.0  # of that side; see `scaled_painting`
    learning_rate: float = 2e-3  # Adam's
    final_learning_rate: float = 3e-4  # reached geometrically
    bfloat16: bool = True  # convolutions in bfloat16 where it is faster
    seed: int = 0

    def __post_init__(self) -> None:
        require_within(SEEDS, self, "seed")
        require_at_least(1, self, "iterations", "batch")
        require_at_least(0, self, "identity_iterations")
        require_at_least(SMALLEST_PX, self, "crop_px", "style_px")
        require_within("[0, 1]", self, "normalization_share")
        rates = "normalization_rate", "learning_rate", "final_learning_rate"
        require_within("(0, inf)", self, *rates, "stroke_scale")
        require_within("[0, inf)", self, "predictor_weight", "color_weight")


Steered = TypeVar("Steered", StyleTrainingConfig, GatysConfig)


def with_style_parameters(config: Steered, stroke_scale: float, content_weight: float) -> Steered:
    """Returns the settings with the painting seen so many times larger, and content counted so."""
    return replace(
        config,
        stroke_scale=stroke_scale * config.stroke_scale,
        loss=replace(config.loss, content_weight=content_weight * config.loss.content_weight),
    )
