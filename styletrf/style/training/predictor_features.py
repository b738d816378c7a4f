"""Style as Gram matrices of the network that distinguishes styles.

VGG16 as this project has it (`styletrf.style.perceptual.perceptual_weights`) has learned contours.
The predictor of arbitrary style transfer (Ghiasi et al. 2017) has learned, from some 80,000
paintings, what makes a style, and distinguishes colors and ornaments that contours do not. With the
Gram matrices G (Gatys et al. 2016, equation 3) of its strides 4, 8 and 16,

    loss = sum over strides of log(1 + |G_output - G_style|^2 / |G_style|^2).
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.style.perceptual.perceptual_loss import gram_matrix, relative_difference
from styletrf.style.transfer.style_predictor import StylePredictor

_LARGEST_STRIDE = 16

Grams = Sequence[Float[Tensor, "1 _ _"]]


def predictor_grams(
    predictor: StylePredictor, painting: Float[Tensor, "1 3 height width"]
) -> Grams:
    """Returns the Gram matrices of the painting, stride by stride: the targets."""
    with torch.no_grad():
        return [gram_matrix(features) for features in predictor.features(painting)]


def predictor_term(
    predictor: StylePredictor,
    grams: Grams,
    images: Float[Tensor, "batch 3 height width"],
    generator: torch.Generator,
) -> Float[Tensor, ""]:
    """Returns how far the images are from the painting; differentiable in the images.

    The images are cropped at a corner that is drawn anew each time, less than a stride from the
    first pixel: a fixed grid of strides favors patterns of its period, which show in the paintings.

    Args:
        predictor: The network.
        grams: From `predictor_grams`.
        images: RGB in [0, 1], of at least 32x32 pixels.
        generator: On the CPU.
    """
    top, left = torch.randint(_LARGEST_STRIDE, (2,), generator=generator).tolist()
    seen = images[..., top:, left:].contiguous(memory_format=torch.channels_last)
    found = predictor.features(seen)
    terms = []
    for features, target in zip(found, grams, strict=True):
        gram = gram_matrix(features)
        terms.append(relative_difference(gram, target.expand_as(gram)))
    return torch.stack(terms).sum()
