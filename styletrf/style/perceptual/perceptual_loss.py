"""The perceptual loss of Johnson et al. 2016: content, style and total variation.

Letters: `F` the activations of a layer (channels C, grid H x W), `G` their Gram matrix.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from styletrf.configuration import require_within
from styletrf.style.perceptual.vgg import LAYERS, VGG16

CONTENT_LAYER = "relu2_2"
STYLE_LAYERS = ("relu1_2", "relu2_2", "relu3_3", "relu4_3")

StyleTerm = Callable[[Mapping[str, Tensor]], Float[Tensor, ""]]
"""Maps the features of an output at the style layers to the unweighted style term."""


@dataclass(frozen=True, slots=True)
class PerceptualLossConfig:
    """The weights of the terms.

    With `relative`, a mean squared difference `d` of features or Gram matrices counts as
    `log(1 + d / t)`, `t` the mean square of its target, layer by layer: of the order of 1 for
    "nothing alike", whichever perceptual network measures and however strong the contrasts of the
    style, and with a bounded gradient however far off. Without it `d` counts as it is, as in most
    published code, whose usual weights are 1e5 and 1e10; these fit the ImageNet weights
    (`torchvision`) only, with all layers at 1.
    """

    content_weight: float = 3.0
    style_weight: float = 1.0
    style_layer_weights: tuple[float, float, float, float] = (
        4.0,
        2.0,
        1.5,
        1.0,
    )  # of STYLE_LAYERS; 0 leaves it out
    tv_weight: float = 15.0
    relative: bool = True
    content_layer: str = CONTENT_LAYER

    def __post_init__(self) -> None:
        if self.content_layer not in LAYERS:
            raise ValueError(f"content_layer is {self.content_layer}, not one of {LAYERS}")
        require_within("[0, inf)", self, "content_weight", "style_weight", "tv_weight")
        weights = self.style_layer_weights
        if min(weights) < 0 or not any(weights):
            raise ValueError(f"style_layer_weights are {weights}, not positive for any layer")

    @property
    def style_layers(self) -> dict[str, float]:
        """The weights of the style layers that have one."""
        weights = zip(STYLE_LAYERS, self.style_layer_weights, strict=True)
        return {layer: weight for layer, weight in weights if weight > 0}


@dataclass(frozen=True, slots=True)
class PerceptualTerms:
    """The weighted terms; `total` is their sum. Scalars, differentiable to the output."""

    content: Float[Tensor, ""]
    style: Float[Tensor, ""]
    tv: Float[Tensor, ""]
    temporal: Float[Tensor, ""]  # see `styletrf.style.training.temporal_loss`
    color: Float[Tensor, ""]  # see `styletrf.style.training.step`

    @property
    def total(self) -> Float[Tensor, ""]:
        """The loss."""
        return self.content + self.style + self.tv + self.temporal + self.color


def mean_terms(parts: Sequence[PerceptualTerms]) -> PerceptualTerms:
    """Returns the mean of each term over the parts of a batch."""
    means = {
        field.name: torch.stack([getattr(part, field.name) for part in parts]).mean()
        for field in fields(PerceptualTerms)
    }
    return PerceptualTerms(**means)


def gram_matrix(
    features: Float[Tensor, "batch channels height width"],
) -> Float[Tensor, "batch channels channels"]:
    """Returns `G_ij = sum_xy F_i F_j / (C H W)`, in float32 or better.

    `F` is divided by the root of `C H W` before the product: the undivided sums overflow half
    precision and lose digits in single.
    """
    batch, channels, height, width = features.shape
    wide = features.to(torch.promote_types(features.dtype, torch.float32))
    rows = wide.reshape(batch, channels, -1) / (channels * height * width) ** 0.5
    return torch.bmm(rows, rows.transpose(1, 2))


def total_variation(images: Float[Tensor, "batch 3 height width"]) -> Float[Tensor, ""]:
    """Returns the mean squared difference of horizontal, plus that of vertical neighbors.

    Squared, so that its gradient is finite (zero) on flat areas.
    """
    across = images[..., :, 1:] - images[..., :, :-1]
    down = images[..., 1:, :] - images[..., :-1, :]
    return across.square().mean() + down.square().mean()


def shrunk(style: Float[Tensor, "height width 3"], short_side_px: int) -> Float[Tensor, "1 3 _ _"]:
    """Reduces the painting, low-pass filtered, so that its shorter side is at most this long."""
    image = style.permute(2, 0, 1)[None]
    scale = min(1.0, short_side_px / min(style.shape[:2]))
    size = [max(1, round(side * scale)) for side in style.shape[:2]]
    return functional.interpolate(image, size=size, mode="bilinear", antialias=True)


def style_grams(vgg: VGG16, style: Float[Tensor, "1 3 height width"]) -> dict[str, Tensor]:
    """Returns the Gram matrices of the style image at the style layers: the targets."""
    with torch.no_grad():
        found = vgg.features(style, STYLE_LAYERS)
        return {layer: gram_matrix(features) for layer, features in found.items()}


def perceptual_loss(
    vgg: VGG16,
    output: Float[Tensor, "batch 3 height width"],
    content: Float[Tensor, "batch 3 height width"],
    grams: dict[str, Tensor],
    config: PerceptualLossConfig,
) -> PerceptualTerms:
    """Returns how far `output` is from the objects of `content` and from the painting's style.

    `content`: the squared difference of `config.content_layer`; `style`: the sum over
    `config.style_layers`, each by its weight, of the squared difference of Gram matrices (Johnson
    et al., eq. 2 and 4); `tv`: the total variation of `output`. Each is a mean over elements,
    counted as the configuration says.

    Args:
        vgg: The perceptual network.
        output: The output of the style network, RGB; values may leave [0, 1].
        content: The input of the style network, RGB in [0, 1].
        grams: From `style_grams`.
        config: The weights.
    """
    target = content_features(vgg, content, config)
    return perceptual_terms(vgg, output, target, partial(gram_term, grams, config), config)


@torch.no_grad()
def content_features(
    vgg: VGG16, content: Float[Tensor, "batch 3 height width"], config: PerceptualLossConfig
) -> Float[Tensor, "batch channels _ _"]:
    """Returns the target of the content term: features of `config.content_layer`."""
    return vgg.features(content, [config.content_layer])[config.content_layer]


def perceptual_terms(
    vgg: VGG16,
    output: Float[Tensor, "batch 3 height width"],
    target: Float[Tensor, "batch channels _ _"],
    style_term: StyleTerm,
    config: PerceptualLossConfig,
) -> PerceptualTerms:
    """Returns the perceptual loss with any style term; `target` is of `content_features`."""
    layer = config.content_layer
    found = vgg.features(output, [layer, *config.style_layers])
    none = torch.zeros((), device=output.device)
    return PerceptualTerms(
        content=config.content_weight * _difference(found[layer].float(), target.float(), config),
        style=config.style_weight * style_term(found),
        tv=config.tv_weight * total_variation(output.float()),
        temporal=none,
        color=none,
    )


def gram_term(
    grams: Mapping[str, Tensor], config: PerceptualLossConfig, found: Mapping[str, Tensor]
) -> Float[Tensor, ""]:
    """Returns the difference of Gram matrices, the weighted sum over the style layers."""
    differences = []
    for layer, weight in config.style_layers.items():
        gram = gram_matrix(found[layer])
        differences.append(weight * _difference(gram, grams[layer].expand_as(gram), config))
    return torch.stack(differences).sum()


def color_drift(
    image: Float[Tensor, "images 3 height width"],
    painted: Float[Tensor, "images 3 height width"],
    block_px: int,
) -> Float[Tensor, ""]:
    """Returns how far the mean colors of square blocks are from those of the painted pictures.

    `log(1 + d / t)`, `d` the mean squared difference, `t` the mean square of the target.
    Blocks at the right and at the bottom may be smaller. Differentiable.
    """
    side = min(block_px, *image.shape[2:])
    blocks = [functional.avg_pool2d(p, side, ceil_mode=True) for p in (image, painted)]
    return relative_difference(*blocks)


def relative_difference(found: Tensor, target: Tensor) -> Float[Tensor, ""]:
    """Returns log(1 + d / t), `d` the mean squared difference and `t` the target's mean square."""
    smallest = torch.finfo(target.dtype).tiny
    ratio = functional.mse_loss(found, target) / target.square().mean().clamp(min=smallest)
    return torch.log1p(ratio)


def _difference(found: Tensor, target: Tensor, config: PerceptualLossConfig) -> Tensor:
    if config.relative:
        return relative_difference(found, target)
    return functional.mse_loss(found, target)
