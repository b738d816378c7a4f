"""From raw density to optical thickness and opacity on a GPU, accurate for thin fog.

Triton has neither log1p nor expm1 that its interpreter knows, and its exp and log are the GPU's
approximations: where a difference would cancel, a series is summed instead.
"""

from typing import no_type_check

import triton
import triton.language as tl


@no_type_check
@triton.jit
def log1p_unit(e):
    """Returns log(1 + e) for e in [0, 1], exact for small e: 2 artanh(e / (2 + e))."""
    z = e / (2.0 + e)
    q = z * z
    series = 1.0 / 11 + q * (1.0 / 13 + q * (1.0 / 15))
    series = 1.0 / 5 + q * (1.0 / 7 + q * (1.0 / 9 + q * series))
    return 2.0 * z * (1.0 + q * (1.0 / 3 + q * series))


@no_type_check
@triton.jit
def softplus(x):
    """Returns log(1 + exp(x)) without overflow."""
    return tl.where(x > 0.0, x, 0.0) + log1p_unit(tl.exp(-tl.abs(x)))


@no_type_check
@triton.jit
def sigmoid(x):
    """Returns the derivative of softplus, without overflow."""
    e = tl.exp(-tl.abs(x))
    return tl.where(x < 0.0, e, 1.0) / (1.0 + e)


@no_type_check
@triton.jit
def opacity(tau):
    """Returns 1 - exp(-tau), exact for thin fog: the power series where it converges in float32."""
    t = tl.where(tau < 0.5, tau, 0.5)
    series = 1.0 / 24 - t * (1.0 / 120 - t * (1.0 / 720 - t * (1.0 / 5040)))
    series = t * (1.0 - t * (1.0 / 2 - t * (1.0 / 6 - t * series)))
    return tl.where(tau < 0.5, series, 1.0 - tl.exp(-tau))
