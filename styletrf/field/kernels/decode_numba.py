"""The color network on the CPU: one hidden layer, fused with its gather and its activations.

A sample's hidden values stay in registers and cache instead of passing through memory four times.
Matrices are `[hidden, inputs]` as torch keeps them, and `[inputs, hidden]` where a loop wants it.
Gradients are summed a band of samples at a time, the bands ending between rays: no two bands write
to the same row, and their number is fixed, so the result is the same on any number of threads.
"""

from typing import no_type_check

import numba
import numpy as np

from styletrf.compiled import compiled
from styletrf.field.kernels.trace_numba import sigmoid
from styletrf.field.kernels.vm_numba import BANDS, FAST


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _hidden(components, i0, i1, of_view, r0, r1, matrix, out, k, width):
    """Writes relu(components[i] @ matrix + of_view[r]) of two samples to out[k] and out[k + 1].

    Two at a time, so that an entry of the matrix is fetched half as often.
    """
    n = matrix.shape[0]
    for j in range(width):
        out[k, j] = of_view[r0, j]
    for j in range(width):
        out[k + 1, j] = of_view[r1, j]
    whole = n - n % 4
    for c in range(0, whole, 4):
        x0, x1 = components[i0, c], components[i0, c + 1]
        x2, x3 = components[i0, c + 2], components[i0, c + 3]
        y0, y1 = components[i1, c], components[i1, c + 1]
        y2, y3 = components[i1, c + 2], components[i1, c + 3]
        for j in range(width):
            m0, m1, m2, m3 = matrix[c, j], matrix[c + 1, j], matrix[c + 2, j], matrix[c + 3, j]
            out[k, j] += x0 * m0 + x1 * m1 + x2 * m2 + x3 * m3
            out[k + 1, j] += y0 * m0 + y1 * m1 + y2 * m2 + y3 * m3
    for c in range(whole, n):
        for j in range(width):
            out[k, j] += components[i0, c] * matrix[c, j]
            out[k + 1, j] += components[i1, c] * matrix[c, j]
    for j in range(width):
        out[k, j] = max(out[k, j], np.float32(0))
        out[k + 1, j] = max(out[k + 1, j], np.float32(0))


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _colors(components, pair, of_view, ray, layers, hidden, colors, width):
    """Writes the colors of two samples."""
    i0, i1 = pair
    matrix, output, bias = layers
    _hidden(components, i0, i1, of_view, ray[i0], ray[i1], matrix, hidden, 0, width)
    for k in range(3):
        logit0, logit1 = bias[k], bias[k]
        for j in range(width):
            logit0 += output[k, j] * hidden[0, j]
            logit1 += output[k, j] * hidden[1, j]
        colors[i0, k], colors[i1, k] = sigmoid(logit0), sigmoid(logit1)


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def decode_forward(components, of_view, ray, matrix, output, bias):
    """Returns the colors of samples in [0, 1], `n x 3`.

    Args:
        components: `n inputs`.
        of_view: The term that the view direction of each ray adds to the hidden layer, `rays
            hidden`.
        ray: The ray of each sample.
        matrix: The weights from components to the hidden layer, `inputs hidden`.
        output: The weights from the hidden layer to the logits, `3 hidden`.
        bias: The bias of the logits.
    """
    n, width = components.shape[0], matrix.shape[1]
    colors = np.empty((n, 3), np.float32)
    for band in numba.prange(BANDS):
        hidden = np.empty((2, width), np.float32)
        end = n * (band + 1) // BANDS
        for i in range(n * band // BANDS, end, 2):
            pair, layers = (i, min(i + 1, end - 1)), (matrix, output, bias)
            # A width that is a number in the code leaves its loops no remainder.
            if width == 64:
                _colors(components, pair, of_view, ray, layers, hidden, colors, 64)
            else:
                _colors(components, pair, of_view, ray, layers, hidden, colors, width)
    return colors


@no_type_check
@compiled()
def _band_ends(samples, ray):
    """Returns where each band begins, about equally many samples each, a ray's within one band."""
    n = samples.shape[0]
    first = np.full(BANDS + 1, n, np.int64)
    first[0] = 0
    for band in range(1, BANDS):
        i = max(first[band - 1], n * band // BANDS)
        while 0 < i < n and ray[samples[i]] == ray[samples[i - 1]]:
            i += 1
        first[band] = i
    return first


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _hidden_gradient(output, logit_gradient, hidden, k, out):
    """Writes the gradient of block entry k's hidden values before their rectification."""
    g0, g1, g2 = logit_gradient[k, 0], logit_gradient[k, 1], logit_gradient[k, 2]
    for j in range(output.shape[1]):
        g = g0 * output[0, j] + g1 * output[1, j] + g2 * output[2, j]
        out[k, j] = g if hidden[k, j] > np.float32(0) else np.float32(0)


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _add_outer_products(left, right, rows, target):
    """Adds left[k].T right[rows[k]] over a block to the target, `left columns x right columns`."""
    i0, i1, i2, i3 = rows
    for j in range(target.shape[0]):
        g0, g1, g2, g3 = left[0, j], left[1, j], left[2, j], left[3, j]
        for c in range(target.shape[1]):
            target[j, c] += (
                g0 * right[i0, c] + g1 * right[i1, c] + g2 * right[i2, c] + g3 * right[i3, c]
            )


@no_type_check
@compiled(inline="always", fastmath=FAST)
def _multiply_row(left, k, matrix, out, i):
    """Writes left[k] @ matrix to out[i]."""
    n, width = matrix.shape
    whole = n - n % 4
    for j in range(0, whole, 4):
        g0, g1, g2, g3 = left[k, j], left[k, j + 1], left[k, j + 2], left[k, j + 3]
        for c in range(width):
            out[i, c] += (
                g0 * matrix[j, c]
                + g1 * matrix[j + 1, c]
                + g2 * matrix[j + 2, c]
                + g3 * matrix[j + 3, c]
            )
    for j in range(whole, n):
        for c in range(width):
            out[i, c] += left[k, j] * matrix[j, c]


@no_type_check
@compiled(parallel=True, fastmath=FAST)
def decode_backward(components, of_view, ray, matrix, matrix_t, output, colors, grad, samples):
    """Returns the gradients of components, of_view, matrix_t (`hidden inputs`), output and bias.

    The hidden layer is computed again rather than kept. Samples come in the order of their rays,
    those without a gradient are not among `samples`, and four are taken at a time: the sums over
    samples are loaded and stored a quarter as often.
    """
    n_inputs, width = matrix.shape
    grad_components = np.zeros(components.shape, np.float32)
    grad_view = np.zeros(of_view.shape, np.float32)
    grad_matrix = np.zeros((BANDS, width, n_inputs), np.float32)
    grad_output = np.zeros((BANDS, 3, width), np.float32)
    grad_bias = np.zeros((BANDS, 3), np.float32)
    first = _band_ends(samples, ray)
    for band in numba.prange(BANDS):
        hidden = np.zeros((4, width), np.float32)
        hidden_gradient = np.zeros((4, width), np.float32)
        logit_gradient = np.zeros((4, 3), np.float32)
        of_matrix = np.zeros((width, n_inputs), np.float32)
        of_output = np.zeros((3, width), np.float32)
        for start in range(first[band], first[band + 1], 4):
            n = min(4, first[band + 1] - start)
            i0, i1 = samples[start], samples[start + min(1, n - 1)]
            i2, i3 = samples[start + min(2, n - 1)], samples[start + n - 1]
            _hidden(components, i0, i1, of_view, ray[i0], ray[i1], matrix, hidden, 0, width)
            _hidden(components, i2, i3, of_view, ray[i2], ray[i3], matrix, hidden, 2, width)
            for k in range(4):
                i = samples[start + min(k, n - 1)]
                for o in range(3):
                    slope = colors[i, o] * (np.float32(1) - colors[i, o])
                    logit_gradient[k, o] = grad[i, o] * slope if k < n else 0
                    grad_bias[band, o] += logit_gradient[k, o]
                _hidden_gradient(output, logit_gradient, hidden, k, hidden_gradient)
            _add_outer_products(logit_gradient, hidden, (0, 1, 2, 3), of_output)
            _add_outer_products(hidden_gradient, components, (i0, i1, i2, i3), of_matrix)
            for k in range(n):
                i = samples[start + k]
                _multiply_row(hidden_gradient, k, matrix_t, grad_components, i)
                for j in range(width):
                    grad_view[ray[i], j] += hidden_gradient[k, j]
        grad_matrix[band] = of_matrix
        grad_output[band] = of_output
    return (
        grad_components,
        grad_view,
        grad_matrix.sum(axis=0),
        grad_output.sum(axis=0),
        grad_bias.sum(axis=0),
    )
