"""Style as the moments of a second network's features: the network that distinguishes styles.

VGG16 as this project has it (`styletrf.style.perceptual.perceptual_weights`) has learned contours.
The predictor of arbitrary style transfer (Ghiasi et al. 2017) has learned to represent styles from
some 80,000 paintings, and distinguishes colors and ornaments that contours do not.

A few of its channels are so large that they alone would make up a Gram matrix. So each channel is
standardized by the painting: z = (F - mean F_style) / std F_style. With mean z and M = mean z z^T
over the places of strides 4, 8 and 16,

    loss = sum over strides of log(1 + |M_output - M_style|^2 / |M_style|^2)
                             + log(1 + |mean z_output|^2 / channels).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.style.perceptual.perceptual_loss import relative_difference
from styletrf.style.perceptual.sliced_features import feature_rows
from styletrf.style.transfer.style_predictor import StylePredictor

_LARGEST_STRIDE = 16
LEAST_PX = _LARGEST_STRIDE
"""The least side of a picture that the network takes."""
_LEAST_DEVIATION = 1e-3
"""The least deviation of a channel; one that is flat in the painting would count without bounds."""


@dataclass(frozen=True, slots=True)
class FeatureMoments:
    """The features of the painting at one stride: how they are standardized, and their moments."""

    mean: Float[Tensor, " channels"]
    deviation: Float[Tensor, " channels"]
    second: Float[Tensor, "channels channels"]

    def difference(self, features: Float[Tensor, "batch channels _ _"]) -> Float[Tensor, ""]:
        """Returns the two terms of a stride; the places of all images count alike."""
        rows = self._standardized(features)
        second = relative_difference(_second_moment(rows), self.second)
        return second + rows.mean(dim=0).square().mean().log1p()

    def _standardized(self, features: Tensor) -> Float[Tensor, "places channels"]:
        return (feature_rows(features).float() - self.mean) / self.deviation

    @staticmethod
    def of(features: Float[Tensor, "1 channels _ _"]) -> "FeatureMoments":
        """Returns the moments of the painting's features."""
        rows = feature_rows(features).float()
        mean, deviation = rows.mean(dim=0), rows.std(dim=0, correction=0)
        deviation = deviation.clamp(min=_LEAST_DEVIATION)
        return FeatureMoments(mean, deviation, _second_moment((rows - mean) / deviation))


Moments = Sequence[FeatureMoments]


def predictor_moments(
    predictor: StylePredictor, painting: Float[Tensor, "1 3 height width"]
) -> Moments:
    """Returns the moments of the painting, stride by stride: the targets."""
    with torch.no_grad():
        return [FeatureMoments.of(features) for features in predictor.features(painting)]


def predictor_term(
    predictor: StylePredictor,
    moments: Moments,
    images: Float[Tensor, "batch 3 height width"],
    generator: torch.Generator,
) -> Float[Tensor, ""]:
    """Returns how far the images are from the painting; differentiable in the images.

    The network sees a window at a corner that is drawn again each time, less than a stride from the
    first pixel (of small images nearer): a fixed grid of strides favors patterns of its period,
    which show in the paintings. The window always has the same size: a GPU plans its convolutions
    again for each size, which takes longer than they do.

    Args:
        predictor: The network.
        moments: From `predictor_moments`.
        images: RGB in [0, 1], of at least 16x16 pixels.
        generator: Draws the corner; on the CPU.
    """
    spare = min(_LARGEST_STRIDE, min(images.shape[2:]) - LEAST_PX + 1)
    top, left = torch.randint(spare, (2,), generator=generator).tolist()
    height, width = (side - spare + 1 for side in images.shape[2:])
    window = images[..., top : top + height, left : left + width]
    seen = window.contiguous(memory_format=torch.channels_last)
    found = zip(predictor.features(seen), moments, strict=True)
    return torch.stack([target.difference(features) for features, target in found]).sum()


def _second_moment(
    rows: Float[Tensor, "places channels"],
) -> Float[Tensor, "channels channels"]:
    return rows.T @ rows / len(rows)
