"""Weights along a ray, raised to a power: colors of a crisp surface where the density is fuzzy.

A color is the sum over a ray of w_i c_i (Max 1995). Where the density of a surface is spread along
the rays, as on a bare wall, that sum blurs the colors of the surface in all views but one. Powers
of the weights, normalized to the same sum, are the weights of a thinner surface at the same place:

    w'_i = (sum_j w_j) w_i^p / sum_j w_j^p,   p >= 1; w' = w for p = 1.

The density stays as it is, and with it opacity and depth.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.field.kernels import Kernels, Samples

LARGEST_POWER = 8.0  # of 30,000 equal weights the eighth powers are still numbers in float32


def sharpened(
    samples: Samples, power: float | Float[Tensor, " samples"], kernels: Kernels
) -> Samples:
    """Returns the samples with the weights w' from above; differentiable in the weights.

    Args:
        samples: The samples, with weights of at least 0.
        power: The power of all samples or of each, from 1 to `LARGEST_POWER`: beyond, a ray could
            lose its weights to rounding.
        kernels: The backend to compute with.
    """
    if isinstance(power, float) and power == 1:
        return samples
    smallest = torch.finfo(samples.weights.dtype).tiny
    opacity = kernels.opacity(samples)[samples.ray]
    fractions = (samples.weights / opacity.clamp(min=smallest)) ** power
    total = kernels.opacity(replace(samples, weights=fractions))[samples.ray]
    return replace(samples, weights=opacity * fractions / total.clamp(min=smallest))
