"""Compares the look of two pictures, and their style, by the features of VGG16."""

from collections.abc import Mapping, Sequence
from typing import final

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional

from styletrf.evaluation.metrics import Image
from styletrf.style.perceptual.perceptual_loss import STYLE_LAYERS, gram_matrix, shrunk
from styletrf.style.perceptual.vgg import REDUCTION, VGG16

Features = Mapping[str, Float[Tensor, "1 _ _ _"]]
Grams = Mapping[str, Float[Tensor, "1 _ _"]]


@final
class PerceptualFeatures:
    """Computes features of pictures by VGG16, at the size at which they are compared."""

    def __init__(self, vgg: VGG16, long_side_px: int) -> None:
        """Uses `vgg` on pictures whose longer side is reduced to at most `long_side_px`."""
        self._vgg, self._long_side_px = vgg, long_side_px

    @property
    def device(self) -> torch.device:
        """The device on which it computes."""
        return self._vgg.mean.device

    def features(self, image: Image) -> Features:
        """Returns the features at relu1_2, relu2_2, relu3_3 and relu4_3."""
        return self.features_of([image])[0]

    @torch.inference_mode()
    def features_of(self, images: Sequence[Image]) -> list[Features]:
        """Returns the features of pictures of one size, computed together."""
        height, width = images[0].shape[:2]
        short_px = self._long_side_px * min(height, width) // max(height, width)
        tensors = torch.from_numpy(np.stack(images).astype(np.float32)).to(self.device).clamp(0, 1)
        small = torch.cat([shrunk(image, max(short_px, REDUCTION)) for image in tensors])
        fast = small.contiguous(memory_format=torch.channels_last)
        found = self._vgg.features(fast, STYLE_LAYERS)
        return [{n: f[k : k + 1] for n, f in found.items()} for k in range(len(images))]

    def distance(self, a: Image, b: Image) -> float:
        """Returns the perceptual distance of two pictures of one size."""
        return perceptual_distance(self.features(a), self.features(b))


@torch.inference_mode()
def perceptual_distance(
    a: Features, b: Features, mask: Bool[np.ndarray, "height width"] | None = None
) -> float:
    """Returns the mean over layers and places of |f_a / |f_a| - f_b / |f_b||^2, in [0, 2].

    LPIPS (Zhang et al. 2018, equation 1) with all channels weighted alike: 0 for equal pictures.
    With a mask of the pictures, each place counts by the fraction of its pixels that are in it; NaN
    where none is. Not differentiable.
    """
    distances = []
    for layer in STYLE_LAYERS:
        unit_a, unit_b = (functional.normalize(f[layer].float(), dim=1) for f in (a, b))
        distance = (unit_a - unit_b).square().sum(dim=1)
        if mask is not None:
            fraction = _fractions(mask, distance)
            distance = distance * fraction / fraction.mean()
        distances.append(distance.mean())
    return float(torch.stack(distances).mean())


def _fractions(mask: Bool[np.ndarray, "_ _"], like: Float[Tensor, "1 _ _"]) -> Tensor:
    pixels = torch.from_numpy(mask).to(like)[None, None]
    rows, columns = like.shape[-2:]
    return functional.adaptive_avg_pool2d(pixels, (rows, columns))[0]


def masked_distances(
    perception: PerceptualFeatures,
    a: Sequence[Image],
    features_a: Sequence[Features],
    b: Sequence[Image],
    mask: Bool[np.ndarray, "height width"],
) -> list[float]:
    """Returns the perceptual distance of each `a` and `b` where the mask is true.

    NaN where it never is. Outside of it `b` is given the pixels of `a`, so that nothing there
    differs.
    """
    if not mask.any():
        return [float("nan")] * len(a)
    filled = [np.where(mask[..., None], y, x) for x, y in zip(a, b, strict=True)]
    pairs = zip(features_a, perception.features_of(filled), strict=True)
    return [perceptual_distance(x, y, mask) for x, y in pairs]


@torch.inference_mode()
def grams(features: Features) -> Grams:
    """Returns the Gram matrix of each layer, which describes a style wherever it is."""
    return {layer: gram_matrix(features[layer]) for layer in STYLE_LAYERS}


@torch.inference_mode()
def style_distance(found: Grams, painting: Grams) -> float:
    """Returns the mean over layers of |G - G_s| / |G_s|, `G` and `G_s` the Gram matrices.

    The distance is 0 for the painting itself, about 1 and more for pictures that have nothing of
    it.
    """
    ratios = []
    for layer, target in painting.items():
        smallest = torch.finfo(target.dtype).tiny
        ratios.append((found[layer] - target).norm() / target.norm().clamp(min=smallest))
    return float(torch.stack(ratios).mean())
