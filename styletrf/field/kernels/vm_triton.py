"""Vector-matrix interpolation on a GPU, forward and backward.

A program takes a block of samples and all channels of a lattice point at once: they lie side by
side in memory, so that a warp's loads and atomic additions are coalesced. A rank that is no power
of two pads its tile, and the padding is masked. Grid coordinates and their clamping are those of
`reference`; a coordinate that is NaN reads within bounds and gives NaN.

Gradients are added atomically: which of many samples is added first varies from run to run, and
with it the last bits of the sums. (On the CPU samples are sorted, and sums always the same.)

Sample and cell numbers are 64-bit before they are multiplied: positions times channels pass 2^31.
"""

from collections.abc import Sequence
from typing import no_type_check

import torch
import triton
import triton.language as tl
from jaxtyping import Float
from torch import Tensor

from styletrf.field.tensor_vm import LINE_AXES, PLANE_AXES

KernelFactors = tuple[tuple[Tensor, ...], tuple[Tensor, ...], tuple[int, int, int], tuple[int, ...]]

BLOCK = 32  # samples a program
SIZES = ["n", "n_x", "n_y", "n_z"]  # they change too often to compile for each


@no_type_check
@triton.jit
def lattice_cell(x, n):
    """Returns the two lattice indices around coordinate x on n points, and the fraction."""
    x = tl.where(x < -1.0, -1.0, tl.where(x > 1.0, 1.0, x))
    position = (x + 1.0) * 0.5 * (n - 1)
    lower = tl.where(position > 0.0, position, 0.0).to(tl.int32)
    lower = tl.minimum(lower, tl.maximum(n - 2, 0))
    return lower, tl.minimum(lower + 1, n - 1), position - lower


@no_type_check
@triton.jit
def plane_corners(u, v, n_u, n_v):
    """Returns the numbers of the cell's corners (v, u) = 00, 01, 10, 11, and their weights."""
    u0, u1, fu = lattice_cell(u, n_u)
    v0, v1, fv = lattice_cell(v, n_v)
    row0, row1 = v0.to(tl.int64) * n_u, v1.to(tl.int64) * n_u
    weights = ((1.0 - fv) * (1.0 - fu), (1.0 - fv) * fu, fv * (1.0 - fu), fv * fu)
    return (row0 + u0, row0 + u1, row1 + u0, row1 + u1), weights


@no_type_check
@triton.jit
def line_ends(w, n_w):
    """Returns the numbers of the two points around w, and their weights."""
    w0, w1, fw = lattice_cell(w, n_w)
    return (w0.to(tl.int64), w1.to(tl.int64)), (1.0 - fw, fw)


@no_type_check
@triton.jit
def channel_tile(live, RANK: tl.constexpr):
    """Returns the channels as a row, and which of live samples x channels there are."""
    channel = tl.arange(0, triton.next_power_of_2(RANK))[None, :]
    return channel, live[:, None] & (channel < RANK)


@no_type_check
@triton.jit
def interpolated(factor, points, weights, live, RANK: tl.constexpr):
    """Returns the weighted sum of a factor's lattice points, samples x channels."""
    channel, mask = channel_tile(live, RANK)
    total = tl.zeros(mask.shape, tl.float32)
    for k in tl.static_range(len(points)):
        address = factor + points[k][:, None] * RANK + channel
        total += weights[k][:, None] * tl.load(address, mask=mask, other=0.0)
    return total


@no_type_check
@triton.jit
def vm_products(plane, line, u, v, w, n_u, n_v, n_w, live, RANK: tl.constexpr):
    """Returns plane(u, v) x line(w) of every component, samples x channels."""
    corners, of_corners = plane_corners(u, v, n_u, n_v)
    ends, of_ends = line_ends(w, n_w)
    on_plane = interpolated(plane, corners, of_corners, live, RANK)
    return on_plane * interpolated(line, ends, of_ends, live, RANK)


@no_type_check
@triton.jit
def density_feature(planes, lines, shape, x, y, z, live, RANKS: tl.constexpr):
    """Returns the raw density at points: the sum over the axis pairs and their components."""
    n_x, n_y, n_z = shape
    xy = vm_products(planes[0], lines[0], x, y, z, n_x, n_y, n_z, live, RANKS[0])
    xz = vm_products(planes[1], lines[1], x, z, y, n_x, n_z, n_y, live, RANKS[1])
    yz = vm_products(planes[2], lines[2], y, z, x, n_y, n_z, n_x, live, RANKS[2])
    return tl.sum(xy, axis=1) + tl.sum(xz, axis=1) + tl.sum(yz, axis=1)


@no_type_check
@triton.jit
def block_of_samples(positions, n, BLOCK: tl.constexpr):
    """Returns the numbers of this program's samples, which there are, and their coordinates."""
    sample = tl.program_id(0).to(tl.int64) * BLOCK + tl.arange(0, BLOCK)
    live = sample < n
    x = tl.load(positions + sample * 3, mask=live, other=0.0)
    y = tl.load(positions + sample * 3 + 1, mask=live, other=0.0)
    z = tl.load(positions + sample * 3 + 2, mask=live, other=0.0)
    return sample, live, x, y, z


@no_type_check
@triton.jit(do_not_specialize=SIZES)
def _density(
    positions, planes, lines, out, n, n_x, n_y, n_z, RANKS: tl.constexpr, BLOCK: tl.constexpr
):  # fmt: skip
    sample, live, x, y, z = block_of_samples(positions, n, BLOCK)
    raw = density_feature(planes, lines, (n_x, n_y, n_z), x, y, z, live, RANKS)
    tl.store(out + sample, raw, mask=live)


@no_type_check
@triton.jit
def _store_columns(out, sample, live, values, RANK: tl.constexpr, WIDTH: tl.constexpr):
    channel, mask = channel_tile(live, RANK)
    tl.store(out + sample[:, None] * WIDTH + channel, values, mask=mask)


@no_type_check
@triton.jit(do_not_specialize=SIZES)
def _features(
    positions, planes, lines, out, n, n_x, n_y, n_z, RANKS: tl.constexpr, BLOCK: tl.constexpr
):  # fmt: skip
    sample, live, x, y, z = block_of_samples(positions, n, BLOCK)
    WIDTH: tl.constexpr = RANKS[0] + RANKS[1] + RANKS[2]
    xy = vm_products(planes[0], lines[0], x, y, z, n_x, n_y, n_z, live, RANKS[0])
    _store_columns(out, sample, live, xy, RANKS[0], WIDTH)
    xz = vm_products(planes[1], lines[1], x, z, y, n_x, n_z, n_y, live, RANKS[1])
    _store_columns(out + RANKS[0], sample, live, xz, RANKS[1], WIDTH)
    yz = vm_products(planes[2], lines[2], y, z, x, n_y, n_z, n_x, live, RANKS[2])
    _store_columns(out + RANKS[0] + RANKS[1], sample, live, yz, RANKS[2], WIDTH)


@no_type_check
@triton.jit
def _scatter(target, points, weights, values, live, RANK: tl.constexpr):
    """Adds the values, divided by weight, to the lattice points of a factor's gradient."""
    channel, mask = channel_tile(live, RANK)
    touched = mask & (values != 0)
    for k in tl.static_range(len(points)):
        address = target + points[k][:, None] * RANK + channel
        tl.atomic_add(address, weights[k][:, None] * values, mask=touched, sem="relaxed")


@no_type_check
@triton.jit(do_not_specialize=[*SIZES, "of_sample", "of_channel"])
def _scatter_pair(
    positions, plane, line, grad, of_sample, of_channel, grad_plane, grad_line, n, n_x, n_y, n_z,
    U: tl.constexpr, V: tl.constexpr, W: tl.constexpr, RANK: tl.constexpr, BLOCK: tl.constexpr,
):  # fmt: skip
    sample, live, x, y, z = block_of_samples(positions, n, BLOCK)
    at, shape = (x, y, z), (n_x, n_y, n_z)
    corners, of_corners = plane_corners(at[U], at[V], shape[U], shape[V])
    ends, of_ends = line_ends(at[W], shape[W])
    channel, mask = channel_tile(live, RANK)
    upstream = grad + sample[:, None] * of_sample + channel * of_channel
    g = tl.load(upstream, mask=mask, other=0.0)
    on_line = interpolated(line, ends, of_ends, live, RANK)
    _scatter(grad_plane, corners, of_corners, g * on_line, live, RANK)
    on_plane = interpolated(plane, corners, of_corners, live, RANK)
    _scatter(grad_line, ends, of_ends, g * on_plane, live, RANK)


def kernel_factors(factors: Sequence[Tensor]) -> KernelFactors:
    """Returns three planes and three lines as the kernels want them, with points and ranks."""
    planes = tuple(plane.detach().contiguous() for plane in factors[:3])
    lines = tuple(line.detach().contiguous() for line in factors[3:])
    n_z, n_y, n_x = (line.shape[0] for line in lines)
    return planes, lines, (n_x, n_y, n_z), tuple(line.shape[1] for line in lines)


def density_features(
    positions: Float[Tensor, "samples 3"], factors: Sequence[Tensor]
) -> Float[Tensor, " samples"]:
    """Returns the raw density at positions."""
    planes, lines, shape, ranks = kernel_factors(factors)
    n = len(positions)
    out = positions.new_empty(n)
    _density[(triton.cdiv(n, BLOCK),)](
        positions.contiguous(), planes, lines, out, n, *shape, ranks, BLOCK
    )
    return out


def features_forward(
    positions: Float[Tensor, "samples 3"], factors: Sequence[Tensor]
) -> Float[Tensor, "samples components"]:
    """Returns the products of all components of the three axis pairs."""
    planes, lines, shape, ranks = kernel_factors(factors)
    n = len(positions)
    out = positions.new_empty(n, sum(ranks))
    _features[(triton.cdiv(n, BLOCK),)](
        positions.contiguous(), planes, lines, out, n, *shape, ranks, BLOCK
    )
    return out


def scatter_gradients(
    positions: Float[Tensor, "samples 3"],
    factors: Sequence[Tensor],
    grad: Float[Tensor, "samples components"],
) -> list[Tensor]:
    """Returns the gradients of planes and lines from that of the components.

    `grad` may be a broadcast view, such as the one number that all summed components share.
    """
    planes, lines, shape, ranks = kernel_factors(factors)
    n = len(positions)
    grads = [torch.zeros_like(factor) for factor in (*planes, *lines)]
    for k, columns in enumerate(grad.split(ranks, dim=1)):
        _scatter_pair[(triton.cdiv(n, BLOCK),)](
            positions.contiguous(), planes[k], lines[k], columns, *columns.stride(),
            grads[k], grads[3 + k], n, *shape, *PLANE_AXES[k], LINE_AXES[k], ranks[k], BLOCK,
        )  # fmt: skip
    return grads
