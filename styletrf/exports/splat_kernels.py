"""Pictures of projected splats by alpha compositing, and their derivatives, compiled.

    alpha_i = min(opacity_i exp(-d^T Sigma_i^-1 d / 2), 0.99),   T_i = product of 1 - alpha_j, j < i
    color = sum_i T_i alpha_i c_i + T_end background

of the splats i of a pixel, nearest first, with d from the splat's center to the pixel's (Kerbl et
al. 2023). A splat has no part in a pixel where alpha is below 1/255.
    d color / d c_i = T_i alpha_i,   d color / d alpha_i = (T_i c_i - what is behind i) / (1 - ...)
"""

from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled

BANDS = 4
LEAST_ALPHA = np.float32(1 / 255)
MOST_ALPHA = np.float32(0.99)


@no_type_check
@compiled(inline="always")
def _columns(at, conic, reach, row, width):
    """Returns the pixels of a row, from and to, where alpha is at least 1/255, and dy."""
    dy = row + np.float32(0.5) - at[1]
    # conic0 dx^2 + 2 conic1 dx dy + conic2 dy^2 <= reach
    half = conic[1] * dy / conic[0]
    rest = half * half - (conic[2] * dy * dy - reach) / conic[0]
    if rest < 0:
        return 0, 0, dy
    wide = np.sqrt(rest)
    middle = at[0] - half - np.float32(0.5)
    first = max(int(np.ceil(middle - wide)), 0)
    last = min(int(np.floor(middle + wide)) + 1, width)
    return first, last, dy


@no_type_check
@compiled(inline="always")
def _falloff(conic, dx, dy):
    """Returns exp(-d^T Sigma^-1 d / 2)."""
    power = conic[0] * dx * dx + 2 * conic[1] * dx * dy
    return np.exp(np.float32(-0.5) * (power + conic[2] * dy * dy))


@no_type_check
@compiled(parallel=True)
def composite(
    order, at, conics, reaches, rows, opacities, colors, background, width, height, least_left
):
    """Returns the picture, `pixels channels`.

    Args:
        order: The splats in the picture, nearest first.
        at: Centers in pixels, `n 2`.
        conics: xx, xy, yy of the inverse covariances, `n 3`.
        reaches: d^T Sigma^-1 d where alpha is 1/255, `n`.
        rows: From and to, of the pixels within reach, `n 2`.
        opacities: `n`.
        colors: `n channels`.
        background: `channels`.
        width: The width of the picture in pixels.
        height: Its height in pixels.
        least_left: A pixel takes no further splats once less is left.
    """
    channels = colors.shape[1]
    left = np.ones(height * width, np.float32)
    picture = np.zeros((height * width, channels), np.float32)
    for band in numba.prange(BANDS):
        top, bottom = height * band // BANDS, height * (band + 1) // BANDS
        for k in order:
            for row in range(max(rows[k, 0], top), min(rows[k, 1], bottom)):
                first, last, dy = _columns(at[k], conics[k], reaches[k], row, width)
                for column in range(first, last):
                    pixel = row * width + column
                    if left[pixel] < least_left:
                        continue
                    dx = column + np.float32(0.5) - at[k, 0]
                    falloff = _falloff(conics[k], dx, dy)
                    alpha = min(opacities[k] * falloff, MOST_ALPHA)
                    weight = left[pixel] * alpha
                    for c in range(channels):
                        picture[pixel, c] += weight * colors[k, c]
                    left[pixel] *= 1 - alpha
        for pixel in range(top * width, bottom * width):
            for c in range(channels):
                picture[pixel, c] += left[pixel] * background[c]
    return picture


@no_type_check
@compiled(parallel=True)
def composite_backward(
    order, at, conics, reaches, rows, opacities, colors, width, height, least_left, picture, slope
):
    """Returns the gradients by `at`, `conics`, `opacities` and `colors`, side by side, `n 6 + c`.

    `picture` is the result of `composite`, and `slope` the gradient by it. Each band of rows has
    sums of its own. They are added in order, so the number of threads does not change the result.
    """
    channels, n = colors.shape[1], at.shape[0]
    of_bands = np.zeros((BANDS, n, 6 + channels), np.float32)
    for band in numba.prange(BANDS):
        top, bottom = height * band // BANDS, height * (band + 1) // BANDS
        left = np.ones((bottom - top) * width, np.float32)
        behind = picture[top * width : bottom * width].copy()
        out = of_bands[band]
        for k in order:
            for row in range(max(rows[k, 0], top), min(rows[k, 1], bottom)):
                first, last, dy = _columns(at[k], conics[k], reaches[k], row, width)
                for column in range(first, last):
                    here = (row - top) * width + column
                    pixel = row * width + column
                    if left[here] < least_left:
                        continue
                    dx = column + np.float32(0.5) - at[k, 0]
                    falloff = _falloff(conics[k], dx, dy)
                    alpha = min(opacities[k] * falloff, MOST_ALPHA)
                    weight, after = left[here] * alpha, 1 - alpha
                    by_alpha = np.float32(0)
                    for c in range(channels):
                        behind[here, c] -= weight * colors[k, c]
                        out[k, 6 + c] += weight * slope[pixel, c]
                        change = left[here] * colors[k, c] - behind[here, c] / after
                        by_alpha += change * slope[pixel, c]
                    left[here] *= after
                    if opacities[k] * falloff >= MOST_ALPHA:
                        continue
                    out[k, 5] += falloff * by_alpha
                    by_power = np.float32(-0.5) * alpha * by_alpha
                    out[k, 0] -= by_power * 2 * (conics[k, 0] * dx + conics[k, 1] * dy)
                    out[k, 1] -= by_power * 2 * (conics[k, 1] * dx + conics[k, 2] * dy)
                    out[k, 2] += by_power * dx * dx
                    out[k, 3] += by_power * 2 * dx * dy
                    out[k, 4] += by_power * dy * dy
    total = of_bands[0]
    for band in range(1, BANDS):
        total += of_bands[band]
    return total
