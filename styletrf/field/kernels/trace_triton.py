"""Marching rays through an occupancy grid on a GPU, density to weights, forward and backward.

A program, one warp, takes one ray: its lanes take STEPS consecutive steps at a time, which read
neighboring cells, and no ray waits for another. Three passes keep the memory to the occupied
samples: `_count` finds how many steps of each ray are occupied, `_march` evaluates the density up
to termination and writes the kept samples into the room so counted, `_pack` closes the gaps. With
optical thickness tau = density x length,

    weight_i = T_i (1 - exp(-tau_i)),   T_i = exp(-sum_{j < i} tau_j)     (Max 1995, eq. 9)

The sum before a sample never holds the sample's own tau: an infinite one is not subtracted again.
"""

from collections.abc import Sequence
from typing import no_type_check

import torch
import triton
import triton.language as tl
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels.samples import March, RaySegments, Samples
from styletrf.field.kernels.thickness_triton import opacity, sigmoid, softplus
from styletrf.field.kernels.vm_triton import density_feature, kernel_factors

SIZES = ["n_x", "n_y", "n_z", "v_x", "v_y", "v_z"]  # of lattice and voxels: not compiled for each
STEPS = 32  # at a time: one a lane


@no_type_check
@triton.jit
def voxel(x, n):
    """Returns the index of the voxel that holds coordinate x, clamped to the grid."""
    position = (x + 1.0) * (0.5 * n)
    position = tl.where(position > 0.0, position, 0.0)
    return tl.where(position < n - 1.0, position, n - 1.0).to(tl.int32)


@no_type_check
@triton.jit
def at_least(transmittance, termination):
    """Returns where a ray goes on; where it is NaN too, so that NaN is seen."""
    return (transmittance >= termination) | (transmittance != transmittance)


@no_type_check
@triton.jit
def point_on(ray, s, origins, directions, ends, PIECES: tl.constexpr):
    """Returns the coordinates of ray(s), each on its piece of the chain."""
    piece = tl.zeros_like(s).to(tl.int64)
    for before in tl.static_range(PIECES - 1):
        piece += (s > tl.load(ends + ray * PIECES + before)).to(tl.int64)
    at = (ray * PIECES + piece) * 3
    x = tl.load(origins + at) + s * tl.load(directions + at)
    y = tl.load(origins + at + 1) + s * tl.load(directions + at + 1)
    z = tl.load(origins + at + 2) + s * tl.load(directions + at + 2)
    return x, y, z


@no_type_check
@triton.jit
def is_occupied(x, y, z, occupancy, voxels, live):
    """Returns which points lie in occupied voxels."""
    n_x, n_y, n_z = voxels
    cell = voxel(x, n_x).to(tl.int64) * n_y + voxel(y, n_y)
    return tl.load(occupancy + cell * n_z + voxel(z, n_z), mask=live, other=0) != 0


@no_type_check
@triton.jit(do_not_specialize=SIZES[3:])
def _count(
    origins, directions, ends, n_steps, jitter, occupancy, v_x, v_y, v_z, count,
    PIECES: tl.constexpr, STEPS: tl.constexpr,
):  # fmt: skip
    ray = tl.program_id(0).to(tl.int64)
    n, jit = tl.load(n_steps + ray).to(tl.int32), tl.load(jitter + ray)
    found = tl.zeros([], tl.int64)
    for first in range(0, n, STEPS):
        step = first + tl.arange(0, STEPS)
        x, y, z = point_on(ray, (step + jit) / n, origins, directions, ends, PIECES)
        occupied = is_occupied(x, y, z, occupancy, (v_x, v_y, v_z), step < n)
        found += tl.sum(occupied.to(tl.int64))
    tl.store(count + ray, found)


@no_type_check
@triton.jit
def _exclusive(before, own, further_before, further_own):
    """Joins two runs of an exclusive sum: the sum before the last sample, and that sample."""
    return before + own + further_before, further_own


@no_type_check
@triton.jit(do_not_specialize=SIZES)
def _march(
    origins, directions, ends, thickness, n_steps, jitter, occupancy, v_x, v_y, v_z,
    planes, lines, n_x, n_y, n_z, room, along, weights, behind, slopes, count, shift, termination,
    RANKS: tl.constexpr, PIECES: tl.constexpr, STEPS: tl.constexpr,
):  # fmt: skip
    ray = tl.program_id(0).to(tl.int64)
    n, jit = tl.load(n_steps + ray).to(tl.int32), tl.load(jitter + ray)
    start, per_softplus = tl.load(room + ray), tl.load(thickness + ray)
    slot = start
    depth, first, lit = tl.zeros([], tl.float32), tl.zeros([], tl.int32), n > 0
    while lit:
        step = first + tl.arange(0, STEPS)
        s = (step + jit) / n
        x, y, z = point_on(ray, s, origins, directions, ends, PIECES)
        occupied = is_occupied(x, y, z, occupancy, (v_x, v_y, v_z), step < n)
        if tl.max(occupied.to(tl.int32)) > 0:
            raw = density_feature(planes, lines, (n_x, n_y, n_z), x, y, z, occupied, RANKS)
            tau = tl.where(occupied, per_softplus * softplus(raw + shift), 0.0)
            before, _ = tl.associative_scan((tl.zeros_like(tau), tau), 0, _exclusive)
            transmittance = tl.exp(-(depth + before))
            kept = occupied & at_least(transmittance, termination)
            at = slot + tl.cumsum(kept.to(tl.int64)) - 1
            tl.store(along + at, s, mask=kept)
            tl.store(weights + at, transmittance * opacity(tau), mask=kept)
            tl.store(behind + at, transmittance * tl.exp(-tau), mask=kept)
            tl.store(slopes + at, per_softplus * sigmoid(raw + shift), mask=kept)
            slot += tl.sum(kept.to(tl.int64))
            depth += tl.sum(tau)
        first += STEPS
        lit = (first < n) & at_least(tl.exp(-depth), termination)
    tl.store(count + ray, slot - start)


@no_type_check
@triton.jit
def _pack(
    origins, directions, ends, room, offsets, along, weights, behind, slopes,
    to_ray, to_s, to_positions, to_weights, to_behind, to_slopes,
    PIECES: tl.constexpr, STEPS: tl.constexpr,
):  # fmt: skip
    ray = tl.program_id(0).to(tl.int64)
    source, target = tl.load(room + ray), tl.load(offsets + ray)
    n = tl.load(offsets + ray + 1) - target
    for first in range(0, n, STEPS):
        k = first + tl.arange(0, STEPS)
        live = k < n
        s = tl.load(along + source + k, mask=live, other=0.0)
        x, y, z = point_on(ray, s, origins, directions, ends, PIECES)
        tl.store(to_ray + target + k, ray, mask=live)
        tl.store(to_s + target + k, s, mask=live)
        tl.store(to_positions + (target + k) * 3, x, mask=live)
        tl.store(to_positions + (target + k) * 3 + 1, y, mask=live)
        tl.store(to_positions + (target + k) * 3 + 2, z, mask=live)
        weight = tl.load(weights + source + k, mask=live, other=0.0)
        tl.store(to_weights + target + k, weight, mask=live)
        tl.store(to_behind + target + k, tl.load(behind + source + k, mask=live), mask=live)
        tl.store(to_slopes + target + k, tl.load(slopes + source + k, mask=live), mask=live)


@no_type_check
@triton.jit
def _raw_gradients(offsets, weights, behind, slopes, grad, grad_raw, STEPS: tl.constexpr):
    ray = tl.program_id(0)
    start, end = tl.load(offsets + ray), tl.load(offsets + ray + 1)
    hidden = tl.zeros([], tl.float32)  # sum of gradient x weight behind the block
    for back in range(0, end - start, STEPS):
        i = end - back - STEPS + tl.arange(0, STEPS)
        live, next_live = i >= start, (i + 1 < end) & (i >= start)
        following = tl.load(grad + i + 1, mask=next_live, other=0.0)
        following *= tl.load(weights + i + 1, mask=next_live, other=0.0)
        g = tl.load(grad + i, mask=live, other=0.0)
        through = tl.load(behind + i, mask=live, other=0.0)
        slope = tl.load(slopes + i, mask=live, other=0.0)
        shaded = hidden + tl.cumsum(following, reverse=True)
        tl.store(grad_raw + i, (g * through - shaded) * slope, mask=live)
        hidden += tl.sum(following)


def trace_forward(
    segments: RaySegments, jitter: Float[Tensor, " rays"], march: March, factors: Sequence[Tensor]
) -> tuple[Samples, Sequence[Tensor]]:
    """Returns the samples; and the transmittance behind each, and d tau / d raw density."""
    planes, lines, shape, ranks = kernel_factors(factors)
    parts = (segments.origins, segments.directions, segments.ends)
    chains, pieces = [part.contiguous() for part in parts], segments.ends.shape[1]
    thickness, n_steps = segments.step_thickness(march.scale), segments.n_steps.contiguous()
    jitter, occupancy = jitter.contiguous(), march.occupancy.contiguous()
    n_rays, voxels = len(segments), tuple(occupancy.shape)
    count = torch.zeros_like(n_steps)
    _count[(n_rays,)](
        *chains, n_steps, jitter, occupancy, *voxels, count, pieces, STEPS, num_warps=1
    )
    room = starts(count)
    padded = tuple(thickness.new_empty(int(room[-1])) for _ in range(4))
    _march[(n_rays,)](
        *chains, thickness, n_steps, jitter, occupancy, *voxels, planes, lines, *shape,
        room, *padded, count, march.shift, march.termination, ranks, pieces, STEPS, num_warps=1,
    )  # fmt: skip
    offsets = starts(count)
    n = int(offsets[-1])
    ray, positions = offsets.new_empty(n), thickness.new_empty(n, 3)
    s, weights, behind, slopes = (thickness.new_empty(n) for _ in range(4))
    _pack[(n_rays,)](
        *chains, room, offsets, *padded, ray, s, positions, weights, behind, slopes,
        pieces, STEPS, num_warps=1,
    )  # fmt: skip
    return Samples(offsets, ray, s, positions, weights), (behind, slopes)


def trace_backward(
    offsets: Int64[Tensor, " rays_and_one"],
    weights: Float[Tensor, " samples"],
    saved: Sequence[Tensor],
    grad: Float[Tensor, " samples"],
) -> Float[Tensor, " samples"]:
    """Returns the gradient of the raw densities from that of the weights.

    dL/dtau_i = g_i T_{i+1} - sum_{j > i} g_j weight_j.
    """
    grad_raw = torch.empty_like(weights)
    _raw_gradients[(len(offsets) - 1,)](
        offsets, weights, *saved, grad.contiguous(), grad_raw, STEPS, num_warps=1
    )
    return grad_raw


def starts(count: Int64[Tensor, " rays"]) -> Int64[Tensor, " rays_and_one"]:
    """Returns where each ray's samples begin, and after the last where they end."""
    return torch.nn.functional.pad(torch.cumsum(count, 0), (1, 0))
