"""Losses of whole renders against a painting itself, beside fitting painted pixels.

`gram` is the perceptual loss of Johnson et al. 2016 (`styletrf.perceptual_loss`); `features` that
of the nearest neighbours (ARF, Zhang et al., ECCV 2022, eq. 2):

    mean over i of min over j of 1 - cos(F_i(render), F_j(painting)),   F of relu3_1 to relu3_3

The content term is that of `styletrf.perceptual_loss`, against the unpainted render.
"""

from collections.abc import Callable
from functools import partial
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.perceptual_loss import (
    CONTENT_LAYER,
    PerceptualLossConfig,
    perceptual_loss,
    relative_difference,
    shrunk,
    style_grams,
    total_variation,
)
from styletrf.vgg import VGG16

ImageLoss = Callable[[Tensor, Tensor], Tensor]
FEATURE_LAYERS = ("relu3_1", "relu3_2", "relu3_3")
_LONGEST_STYLE = 1 << 12  # features of a painting that are compared with
_EPSILON = 1e-6


def stroke_loss(
    kind: Literal["gram", "features"],
    vgg: VGG16,
    style: Float[Tensor, "height width 3"],
    style_px: int,
    config: PerceptualLossConfig,
) -> ImageLoss:
    """Returns the loss as a function of a render and the unpainted render, `1 3 height width`."""
    small = shrunk(style, style_px)
    if kind == "gram":
        grams = style_grams(vgg, small)
        return lambda image, plain: perceptual_loss(vgg, image, plain, grams, config).total
    with torch.no_grad():
        of_style = _columns(vgg, small)
    of_style = of_style[:: -(-len(of_style) // _LONGEST_STYLE)]
    return partial(_feature_loss, vgg, of_style, config)


def _feature_loss(
    vgg: VGG16, of_style: Tensor, config: PerceptualLossConfig, image: Tensor, plain: Tensor
) -> Tensor:
    found = vgg.features(image, [CONTENT_LAYER, *FEATURE_LAYERS])
    with torch.no_grad():
        target = vgg.features(plain, [CONTENT_LAYER])[CONTENT_LAYER].float()
    content = relative_difference(found[CONTENT_LAYER].float(), target)
    near = nearest_distance(_joined(found), of_style)
    smooth = config.tv_weight * total_variation(image)
    return config.style_weight * near + config.content_weight * content + smooth


def nearest_distance(
    features: Float[Tensor, "n channels"], of_style: Float[Tensor, "m channels"]
) -> Float[Tensor, ""]:
    """Returns the mean of 1 - cos to the nearest of the style's features; from 0 to 2.

    Differentiable, with a gradient of zero at features that are zero.
    """
    a, b = _unit(features), _unit(of_style)
    with torch.no_grad():
        nearest = torch.cat([(part @ b.T).argmax(dim=1) for part in a.split(1 << 12)])
    return (1 - (a * b[nearest]).sum(dim=1)).mean()


def _unit(features: Tensor) -> Tensor:
    return features / (features.square().sum(dim=1, keepdim=True) + _EPSILON).sqrt()


def _columns(vgg: VGG16, image: Tensor) -> Tensor:
    return _joined(vgg.features(image, FEATURE_LAYERS))


def _joined(found: dict[str, Tensor]) -> Tensor:
    """Features of the layers side by side, a row a place."""
    parts = [found[layer][0].float().flatten(1) for layer in FEATURE_LAYERS]
    return torch.cat(parts).T
