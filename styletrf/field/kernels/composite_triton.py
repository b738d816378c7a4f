"""Compositing along rays on a GPU, forward and backward, and choosing the samples worth a color.

A program takes one ray and STEPS of its samples at a time; sums need no atomic additions and come
out the same every time.
"""

from typing import no_type_check

import torch
import triton
import triton.language as tl
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels.trace_triton import STEPS, starts
from styletrf.field.kernels.vm_triton import BLOCK, channel_tile


@no_type_check
@triton.jit
def _composite(offsets, weights, values, out, C: tl.constexpr, STEPS: tl.constexpr):
    ray = tl.program_id(0).to(tl.int64)
    start, end = tl.load(offsets + ray), tl.load(offsets + ray + 1)
    total = tl.zeros([triton.next_power_of_2(C)], tl.float32)
    for first in range(start, end, STEPS):
        i = first + tl.arange(0, STEPS)
        weight = tl.load(weights + i, mask=i < end, other=0.0)
        channel, mask = channel_tile(i < end, C)
        value = tl.load(values + i[:, None] * C + channel, mask=mask, other=0.0)
        total += tl.sum(weight[:, None] * value, axis=0)
    channel = tl.arange(0, triton.next_power_of_2(C))
    tl.store(out + ray * C + channel, total, mask=channel < C)


@no_type_check
@triton.jit(do_not_specialize=["n"])
def _composite_gradients(
    ray_of, weights, values, grad, grad_weights, grad_values, n,
    C: tl.constexpr, BLOCK: tl.constexpr,
):  # fmt: skip
    sample = tl.program_id(0).to(tl.int64) * BLOCK + tl.arange(0, BLOCK)
    live = sample < n
    ray = tl.load(ray_of + sample, mask=live, other=0)
    weight = tl.load(weights + sample, mask=live, other=0.0)
    channel, mask = channel_tile(live, C)
    g = tl.load(grad + ray[:, None] * C + channel, mask=mask, other=0.0)
    value = tl.load(values + sample[:, None] * C + channel, mask=mask, other=0.0)
    tl.store(grad_weights + sample, tl.sum(g * value, axis=1), mask=live)
    tl.store(grad_values + sample[:, None] * C + channel, weight[:, None] * g, mask=mask)


@no_type_check
@triton.jit
def is_heavy(weight, threshold):
    """Returns which weights are above the threshold, or NaN, so that NaN is seen."""
    return (weight > threshold) | (weight != weight)


@no_type_check
@triton.jit
def _heavy(offsets, weights, threshold, chosen, count, STEPS: tl.constexpr):
    """Marks the samples heavier than the threshold, else of a faint ray the first heaviest one."""
    ray = tl.program_id(0).to(tl.int64)
    start, end = tl.load(offsets + ray), tl.load(offsets + ray + 1)
    opacity, largest = tl.zeros([], tl.float32), tl.zeros([], tl.float32)
    heaviest, n_heavy = start, tl.zeros([], tl.int64)
    for first in range(start, end, STEPS):
        i = first + tl.arange(0, STEPS)
        weight = tl.load(weights + i, mask=i < end, other=0.0)
        n_heavy += tl.sum(is_heavy(weight, threshold).to(tl.int64))
        opacity += tl.sum(weight)
        here = tl.max(weight)
        heaviest = tl.where(here > largest, tl.min(tl.where(weight == here, i, end)), heaviest)
        largest = tl.where(here > largest, here, largest)
    heaviest = tl.where((n_heavy == 0) & (opacity > threshold), heaviest, end)
    for first in range(start, end, STEPS):
        i = first + tl.arange(0, STEPS)
        weight = tl.load(weights + i, mask=i < end, other=0.0)
        tl.store(chosen + i, is_heavy(weight, threshold) | (i == heaviest), mask=i < end)
    tl.store(count + ray, n_heavy + (heaviest < end).to(tl.int64))


def composite_forward(
    offsets: Int64[Tensor, " rays_and_one"],
    weights: Float[Tensor, " samples"],
    values: Float[Tensor, "samples channels"],
) -> Float[Tensor, "rays channels"]:
    """Returns the weighted sum of the values of each ray's samples."""
    n_rays, channels = len(offsets) - 1, values.shape[1]
    out = values.new_empty(n_rays, channels)
    _composite[(n_rays,)](
        offsets, weights.contiguous(), values.contiguous(), out, channels, STEPS, num_warps=1
    )
    return out


def composite_backward(
    ray: Int64[Tensor, " samples"],
    weights: Float[Tensor, " samples"],
    values: Float[Tensor, "samples channels"],
    grad: Float[Tensor, "rays channels"],
) -> tuple[Float[Tensor, " samples"], Float[Tensor, "samples channels"]]:
    """Returns the gradients of the weights and of the values from that of the sums."""
    values = values.contiguous()
    (n, channels), grad_values = values.shape, torch.empty_like(values)
    grad_weights = torch.empty_like(weights)
    _composite_gradients[(triton.cdiv(n, BLOCK),)](
        ray, weights.contiguous(), values, grad.contiguous(), grad_weights, grad_values, n,
        channels, BLOCK,
    )  # fmt: skip
    return grad_weights, grad_values


def heavy_samples(
    offsets: Int64[Tensor, " rays_and_one"], weights: Float[Tensor, " samples"], threshold: float
) -> tuple[Int64[Tensor, " rays_and_one"], Int64[Tensor, " kept"]]:
    """Returns where each ray's kept samples begin, and which samples those are."""
    chosen = torch.zeros_like(weights, dtype=torch.bool)
    count = torch.zeros_like(offsets[1:])
    _heavy[(len(count),)](
        offsets, weights.contiguous(), threshold, chosen, count, STEPS, num_warps=1
    )
    return starts(count), chosen.nonzero()[:, 0]
