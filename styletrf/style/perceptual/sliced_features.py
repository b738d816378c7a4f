"""Style as the distribution of features: the sliced Wasserstein loss (Heitz et al., CVPR 2021).

A Gram matrix holds the second moments of a layer's features, and many distributions share them:
few pale colors can have the moments of many bright ones. The sliced Wasserstein distance is zero
only between equal distributions. Of one layer, with random unit vectors v,

    SW2 = mean over v, q of (quantile_q(v . F_output) - quantile_q(v . F_style))^2,

and it counts as log(1 + SW2 / variance of F_style): of the order of 1 for "nothing alike".
"""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.style.perceptual.perceptual_loss import STYLE_LAYERS
from styletrf.style.perceptual.vgg import VGG16

_MOST_FEATURES = 2048  # of a layer, drawn again for every look
_PROJECTIONS = 32

Columns = Mapping[str, Float[Tensor, "places channels"]]


def style_columns(vgg: VGG16, style: Float[Tensor, "1 3 height width"]) -> Columns:
    """Returns the features of the style image at the style layers, a row a place: the targets."""
    with torch.no_grad():
        found = vgg.features(style, STYLE_LAYERS)
        return {layer: feature_rows(features).float() for layer, features in found.items()}


def sliced_term(
    columns: Columns,
    layer_weights: Mapping[str, float],
    generator: torch.Generator,
    found: Mapping[str, Tensor],
) -> Float[Tensor, ""]:
    """Returns the relative sliced Wasserstein distances, the weighted sum over layers.

    Differentiable in the features found.

    Args:
        columns: From `style_columns`.
        layer_weights: The weights by layer.
        generator: Draws places and projections; on the CPU.
        found: Features of an output at the style layers.
    """
    distances = []
    for layer, weight in layer_weights.items():
        rows, style = (_drawn(f, generator) for f in (feature_rows(found[layer]), columns[layer]))
        rows = rows.float()
        variance = (style - style.mean(dim=0)).square().mean()
        distance = sliced_wasserstein(rows, style, generator)
        smallest = torch.finfo(variance.dtype).tiny
        distances.append(weight * torch.log1p(distance / variance.clamp(min=smallest)))
    return torch.stack(distances).sum()


def sliced_wasserstein(
    first: Float[Tensor, "n channels"],
    second: Float[Tensor, "m channels"],
    generator: torch.Generator,
    projections: int = _PROJECTIONS,
) -> Float[Tensor, ""]:
    """Returns the mean over random directions of the squared 2-Wasserstein distance; at least 0.

    Of samples of different numbers, the quantiles of the first's are compared. Differentiable in
    both.
    """
    directions = torch.randn((first.shape[1], projections), generator=generator).to(first)
    directions = directions / directions.norm(dim=0)
    a, b = ((rows @ directions).sort(dim=0).values for rows in (first, second))
    if len(a) != len(b):
        quantiles = (torch.arange(len(a), device=b.device) + 0.5) / len(a)
        b = b[(quantiles * len(b)).long()]
    difference: Tensor = (a - b).square().mean()
    return difference


def feature_rows(
    features: Float[Tensor, "batch channels _ _"],
) -> Float[Tensor, "places channels"]:
    """Returns the features of all places of a batch, a row a place."""
    return features.movedim(1, -1).reshape(-1, features.shape[1])


def _drawn(rows: Tensor, generator: torch.Generator) -> Tensor:
    if len(rows) <= _MOST_FEATURES:
        return rows
    draws = torch.randperm(len(rows), generator=generator)[:_MOST_FEATURES]
    return rows[draws.to(rows.device)]
