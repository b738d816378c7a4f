"""The settings of a style training."""

from dataclasses import dataclass, field, replace
from typing import TypeVar

from styletrf.gatys import GatysConfig
from styletrf.perceptual_loss import PerceptualLossConfig
from styletrf.steadiness import SteadinessConfig
from styletrf.style_network import StyleNetworkConfig


@dataclass(frozen=True, slots=True)
class StyleTrainingConfig:
    """How a style network is trained."""

    network: StyleNetworkConfig = field(default_factory=StyleNetworkConfig)
    loss: PerceptualLossConfig = field(default_factory=PerceptualLossConfig)
    steadiness: SteadinessConfig = field(default_factory=SteadinessConfig)
    iterations: int = 2000
    warm_start: bool = True  # from the base network of this size, where there is one
    identity_iterations: int = 150  # without one: the first learn to repeat the photograph
    batch: int = 4
    crop_px: int = 256
    style_px: int = 288  # shorter side of the style image: the smaller, the finer the strokes
    learning_rate: float = 2e-3  # Adam's
    final_learning_rate: float = 3e-4  # reached geometrically
    bfloat16: bool = True  # convolutions in bfloat16 where the hardware computes in it
    seed: int = 0


Steered = TypeVar("Steered", StyleTrainingConfig, GatysConfig)


def steered(config: Steered, stroke_scale: float, content_weight: float) -> Steered:
    """Returns the settings with the painting seen so many times larger, and content counted so."""
    return replace(
        config,
        style_px=max(1, round(stroke_scale * config.style_px)),
        loss=replace(config.loss, content_weight=content_weight * config.loss.content_weight),
    )
