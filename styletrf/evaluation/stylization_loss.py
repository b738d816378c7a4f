"""One number for how well stylized frames keep the painting's style and the scene's objects.

The number is the loss that style networks are trained for (Johnson et al. 2016), measured on the
final frames: a loss of quality in any stage shows here.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
import torch
from torch import Tensor

from styletrf.configuration import require_at_least
from styletrf.evaluation.metrics import Image
from styletrf.even_spread import evenly_spread
from styletrf.finiteness import require_finite
from styletrf.progress import Progress, silent
from styletrf.style.perceptual.perceptual_loss import (
    PerceptualLossConfig,
    perceptual_loss,
    shrunk,
    style_grams,
)
from styletrf.style.perceptual.vgg import REDUCTION, VGG16


@dataclass(frozen=True, slots=True)
class StylizationLossConfig:
    """Settings of the measurement, the same for all settings of the stages before.

    Attributes:
        frames: How many are measured, spread over the trajectory.
        style_px: The shorter side to which the painting is reduced.
        loss: The weights of the terms.
    """

    frames: int = 8
    style_px: int = 420
    loss: PerceptualLossConfig = field(default_factory=PerceptualLossConfig)

    def __post_init__(self) -> None:
        require_at_least(1, self, "frames")
        require_at_least(REDUCTION, self, "style_px")


@dataclass(frozen=True, slots=True)
class StylizationLoss:
    """The weighted terms of the loss of one frame, and their sum."""

    view: str
    style: float
    content: float
    style_and_content: float


@torch.inference_mode()
def measure_stylization(
    views: Sequence[str],
    frames: Callable[[str], tuple[Image, Image]],
    painting: Image,
    vgg: VGG16,
    config: StylizationLossConfig,
    progress: Progress = silent,
) -> tuple[list[StylizationLoss], dict[str, float]]:
    """Returns the losses of some views and their means.

    Args:
        views: Names along the trajectory, of which `config.frames` are chosen evenly.
        frames: Gives the unstylized and the stylized frame of a view, in [0, 1].
        painting: The style image, in [0, 1].
        vgg: The perceptual network.
        config: Which frames are measured, and how.
        progress: Called after every frame.

    Raises:
        NotFiniteError: A frame or a term of its loss is not finite.
    """
    grams = style_grams(vgg, shrunk(_tensor(painting, vgg)[0].permute(1, 2, 0), config.style_px))
    chosen = evenly_spread(range(len(views)), config.frames)
    rows = []
    for k in chosen:
        plain, painted = (_tensor(image, vgg) for image in frames(views[k]))
        terms = perceptual_loss(vgg, painted, plain, grams, config.loss)
        named = [("unstylized", plain), ("stylized", painted)]
        named += [("style loss", terms.style), ("content loss", terms.content)]
        require_finite("stylization loss", f"in frame {views[k]}", named)
        style, content = float(terms.style), float(terms.content)
        rows.append(StylizationLoss(views[k], style, content, style + content))
        progress(len(rows), len(chosen), loss=style + content)
    names = ("style", "content", "style_and_content")
    return rows, {name: float(np.mean([asdict(row)[name] for row in rows])) for name in names}


def _tensor(image: Image, vgg: VGG16) -> Tensor:
    tensor = torch.from_numpy(np.ascontiguousarray(image, dtype=np.float32))
    return tensor.clamp(0, 1).permute(2, 0, 1)[None].to(vgg.mean.device)
