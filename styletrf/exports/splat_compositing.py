"""Pictures of splats from their footprints: alpha compositing, and its derivatives.

    alpha_i = opacity_i share_i,   T_i = product of 1 - alpha_j of all j before i
    color = sum_i T_i alpha_i c_i + T_end background

linear in the colors c; d color / d alpha_i = T_i (c_i - what is behind i).
"""

from typing import no_type_check

import numpy as np

from styletrf.compiled import compiled
from styletrf.exports.splat_footprints import MOST_ALPHA


@compiled()
@no_type_check
def weights_of(n_pixels, pixel, splat, share, opacities):
    """Returns T_i alpha_i of all entries, and the transmittance that is left of each pixel."""
    left = np.ones(n_pixels, np.float32)
    weights = np.empty(len(pixel), np.float32)
    for i in range(len(pixel)):
        alpha = min(opacities[splat[i]] * share[i], MOST_ALPHA)
        weights[i] = left[pixel[i]] * alpha
        left[pixel[i]] *= 1 - alpha
    return weights, left


@compiled()
@no_type_check
def to_pixels(pixel, splat, weights, values, out):
    """Adds to each pixel the weighted values of its splats."""
    for i in range(len(pixel)):
        for c in range(values.shape[1]):
            out[pixel[i], c] += weights[i] * values[splat[i], c]


@compiled()
@no_type_check
def to_splats(pixel, splat, weights, values, out):
    """Adds to each splat the weighted values of its pixels."""
    for i in range(len(pixel)):
        for c in range(values.shape[1]):
            out[splat[i], c] += weights[i] * values[pixel[i], c]


@compiled()
@no_type_check
def opacity_slopes(pixel, splat, share, opacities, colors, shown, lacking, lift, total, row):
    """Adds to `lift` and `total` of each splat what an opacity step needs.

    With J the derivative of a pixel's colors by an opacity: `lift` sums J . lacking, `total` sums
    |J| times the pixel's sum of |J| (`row`, filled here, has to be 0).
    """
    left = np.ones(len(shown), np.float32)
    before = np.zeros_like(shown)
    slopes = np.empty((len(pixel), 3), np.float32)
    for i in range(len(pixel)):
        p, s = pixel[i], splat[i]
        alpha = min(opacities[s] * share[i], MOST_ALPHA)
        weight, after = left[p] * alpha, 1 - alpha
        for c in range(3):
            before[p, c] += weight * colors[s, c]
            behind = (shown[p, c] - before[p, c]) / after
            slopes[i, c] = share[i] * (left[p] * colors[s, c] - behind)
            row[p, c] += abs(slopes[i, c])
        left[p] *= after
    for i in range(len(pixel)):
        p, s = pixel[i], splat[i]
        for c in range(3):
            lift[s] += slopes[i, c] * lacking[p, c]
            total[s] += abs(slopes[i, c]) * row[p, c]
