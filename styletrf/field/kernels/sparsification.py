"""Drops most rows of a gradient without changing its mean.

A few samples carry nearly all of the gradient that reaches the factors (on a fitted scene a fifth
of them 97 %), and adding a row to the factors costs the same whatever its size. Row i is kept with
probability

    p_i = min(1, |g_i| / threshold)

and divided by it, so that the mean over `offset` is the gradient itself (Wangni et al. 2018). Which
rows are kept is drawn systematically (Madow 1949): those at which the running sum of p, begun at
`offset`, passes a whole number. The number kept then varies by less than one, and one random number
does for all.
"""

from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Sparsification:
    """`threshold` in mean magnitudes of the rows that are not zero; `offset` in [0, 1)."""

    threshold: float
    offset: float


def sparsified(
    gradient: Float[Tensor, "samples channels"], sparsification: Sparsification | None
) -> Float[Tensor, "samples channels"]:
    """Returns the gradient with most of its small rows zero and the others the larger for it.

    A gradient that is not finite is returned as it is, to be seen.
    """
    if sparsification is None or sparsification.threshold <= 0:
        return gradient
    magnitude = gradient.abs().sum(dim=1, dtype=torch.float64)
    threshold = sparsification.threshold * magnitude.sum() / magnitude.count_nonzero().clamp(min=1)
    if not 0 < float(threshold) < torch.inf:
        return gradient
    p = (magnitude / threshold).clamp(max=1)
    passed = p.cumsum(0) + sparsification.offset
    kept = passed.floor() > (passed - p).floor()
    return torch.where(kept, 1 / p, 0).to(gradient.dtype)[:, None] * gradient


def sparsify_gradient(
    values: Float[Tensor, "samples channels"], sparsification: Sparsification | None
) -> Float[Tensor, "samples channels"]:
    """Returns the values; their gradient is sparsified on its way back."""
    result: Tensor = _Sparsify.apply(values, sparsification)  # type: ignore[no-untyped-call]
    return result


class _Sparsify(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, sparsification: Sparsification | None) -> Tensor:
        ctx.sparsification = sparsification
        return values.view_as(values)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None]:
        return sparsified(grads[0], ctx.sparsification), None
