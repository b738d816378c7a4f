"""Chooses the power of a style's weights by how crisp its frames are beside its priors.

A higher power keeps strokes crisp where density is spread along the rays
(`styletrf.field.weight_sharpening`). It costs temporal consistency, and it adds grain.
Wide soft strokes need none. So the lowest power is taken with which renders at the priors' cameras
are nearly as sharp as the priors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import UInt8
from torch import Tensor

from styletrf.evaluation.sharpness import sharpness
from styletrf.even_spread import evenly_spread
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.field.weight_sharpening import LARGEST_POWER
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.trajectory.frames import rendered


@dataclass(frozen=True, slots=True)
class PowerChoiceConfig:
    """Settings of the choice of a power.

    Attributes:
        powers: In ascending order, each from 1 to 8 (`styletrf.field.weight_sharpening`).
        sharpness: The fraction of the priors' sharpness that is enough.
        views: The number of the priors' cameras that renders are compared at.
        render: The settings of these renders.
    """

    powers: tuple[float, ...] = (1.0, 1.5, 2.0)
    sharpness: float = 0.88
    views: int = 3
    render: RenderConfig = field(
        default_factory=lambda: RenderConfig(termination=5e-2, min_weight=5e-2)
    )

    def __post_init__(self) -> None:
        bounded = [1.0, *self.powers, LARGEST_POWER]
        if not self.powers or bounded != sorted(bounded):
            raise ValueError(f"powers are {self.powers}, not ascending from 1 to {LARGEST_POWER:g}")
        if self.views < 1:
            raise ValueError("views is at least 1")


def choose_weight_power(
    radiance: RadianceField,
    cameras: Sequence[Camera],
    painted: UInt8[Tensor, "views height width 3"],
    space: Space,
    config: PowerChoiceConfig,
) -> float:
    """Sets the lowest power that is sharp enough, else the highest, and returns it.

    Args:
        radiance: The field, fitted to the painted views; only its power changes.
        cameras: The cameras of the painted views.
        painted: The views.
        space: The space of the scene.
        config: The powers to try.
    """
    chosen = evenly_spread(range(len(cameras)), config.views)
    wanted = np.mean([sharpness(painted[k].cpu().numpy() / np.float32(255)) for k in chosen])
    for power in config.powers:
        radiance.appearance.weight_power = power
        if power == config.powers[-1]:
            break
        seen_from = [cameras[k] for k in chosen]
        shown = rendered(radiance, space, seen_from, config.render, painted.device)
        found = np.mean([sharpness(render.color.numpy()) for render in shown])
        if found >= config.sharpness * wanted:
            break
    return radiance.appearance.weight_power
