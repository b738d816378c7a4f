"""The reference of the kernels, in torch alone: at any precision and on any device.

Every sample of every ray is laid out in a dense `rays x steps` array and masked.
"""

import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torch.nn import functional

from styletrf.field.kernels.samples import March, RaySegments, Samples
from styletrf.field.kernels.sparsification import sparsify_gradient
from styletrf.field.tensor_vm import LINE_AXES, PLANE_AXES, TensorVM


def features(
    factors: TensorVM, positions: Float[Tensor, "samples 3"]
) -> Float[Tensor, "samples components"]:
    """Returns plane x line of every component at grid positions, differentiable in the factors.

    Positions outside the grid take the value at its border; one that is NaN gives NaN.
    """
    columns = []
    for (u, v), w, plane, line in zip(
        PLANE_AXES, LINE_AXES, factors.planes, factors.lines, strict=True
    ):
        on_plane = _interpolate(plane, positions[:, u], positions[:, v])
        on_line = _interpolate(line[:, None], torch.zeros_like(positions[:, w]), positions[:, w])
        columns.append(on_plane * on_line)
    return torch.cat(columns, dim=-1)


def density(factors: TensorVM, positions: Float[Tensor, "samples 3"]) -> Float[Tensor, " samples"]:
    """Returns the raw density, the sum of the features."""
    return features(factors, positions).sum(dim=-1)


def trace(
    factors: TensorVM, segments: RaySegments, jitter: Float[Tensor, " rays"], march: March
) -> Samples:
    """Returns the samples of the rays in occupied voxels, up to termination, with their weights.

    Sample k of a ray lies at s = (k + jitter) / n_steps. With tau = density x length / n_steps,

        weight_i = exp(-sum_{j < i} tau_j) (1 - exp(-tau_i))        (Max 1995)

    and a ray ends after the sample that brings its transmittance below `march.termination`. Where
    the factors are NaN, the weights are NaN, and the ray goes on.
    """
    steps = torch.arange(int(segments.n_steps.max()) if len(segments) else 0)
    steps = steps.to(segments.origins.device)
    n = segments.n_steps[:, None].clamp(min=1)
    s = (steps + jitter[:, None]) / n
    rays = torch.arange(len(s), device=s.device)[:, None].expand_as(s)
    positions = segments.positions_at(rays.reshape(-1), s.reshape(-1)).reshape(*s.shape, 3)
    mask = (steps < segments.n_steps[:, None]) & _occupied(march, positions)
    of_samples = sparsify_gradient(density(factors, positions[mask])[:, None], march.sparsification)
    raw = torch.zeros_like(s).masked_scatter(mask, of_samples)
    thickness = segments.step_thickness(march.scale)[:, None]
    tau = torch.where(mask, thickness * functional.softplus(raw + march.shift), 0.0)
    # Summed before the sample, not up to it and subtracted again: tau may be infinite.
    optical_depth = torch.cat(
        [torch.zeros_like(tau[:, :1]), torch.cumsum(tau, dim=1)[:, :-1]], dim=1
    )
    transmittance = torch.exp(-optical_depth)
    weights = transmittance * -torch.expm1(-tau)
    mask = mask & ~(transmittance.detach() < march.termination)
    ray, step = mask.nonzero(as_tuple=True)
    counts = torch.cat([mask.new_zeros(1, dtype=torch.int64), mask.sum(dim=1)])
    return Samples(
        torch.cumsum(counts, 0), ray, s[ray, step], positions[ray, step], weights[ray, step]
    )


def prune(samples: Samples, threshold: float) -> Samples:
    """Returns the samples worth a color, differentiable in the weights.

    These are the samples heavier than `threshold`, and, of a ray that has none but more opacity
    than that (a faint ray), its first heaviest one. A weight that is NaN is kept, to be seen.
    """
    weights, rays, n = samples.weights.detach(), len(samples.offsets) - 1, len(samples.weights)
    opacity = weights.new_zeros(rays).index_add(0, samples.ray, weights)
    largest = weights.new_zeros(rays).scatter_reduce(0, samples.ray, weights, "amax")
    stands_for_ray = (opacity > threshold) & (largest <= threshold)
    sample = torch.arange(n, device=weights.device)
    heaviest = torch.full_like(samples.offsets[1:], n)
    ties = weights == largest[samples.ray]
    heaviest = heaviest.scatter_reduce(0, samples.ray[ties], sample[ties], "amin")
    of_faint_ray = stands_for_ray[samples.ray] & (sample == heaviest[samples.ray])
    kept = (~(weights <= threshold) | of_faint_ray).nonzero()[:, 0]
    bounds = torch.arange(rays + 1, device=kept.device)
    return samples.chosen(torch.searchsorted(samples.ray[kept], bounds), kept)


def composite(
    samples: Samples, values: Float[Tensor, "samples channels"]
) -> Float[Tensor, "rays channels"]:
    """Returns the weighted sum of the values along each ray."""
    out = values.new_zeros(len(samples.offsets) - 1, values.shape[1])
    return out.index_add(0, samples.ray, samples.weights[:, None] * values)


def decode(
    components: Float[Tensor, "samples inputs"],
    of_view: Float[Tensor, "rays hidden"],
    ray: Int64[Tensor, " samples"],
    matrix: Float[Tensor, "hidden inputs"],
    output: Float[Tensor, "3 hidden"],
    bias: Float[Tensor, " 3"],
) -> Float[Tensor, "samples 3"]:
    """Returns the colors of samples in [0, 1], differentiable in all but `ray`.

    sigmoid(output @ relu(matrix @ components + of_view[ray]) + bias); samples are in the order of
    their rays, and `of_view` is the term that the view direction of a ray adds to the hidden layer.
    """
    hidden = torch.relu(components @ matrix.T + of_view.index_select(0, ray))
    return torch.sigmoid(hidden @ output.T + bias)


def _occupied(march: March, positions: Float[Tensor, "*batch 3"]) -> Tensor:
    n = torch.tensor(march.occupancy.shape, device=positions.device)
    voxel = torch.nan_to_num((positions + 1) * (0.5 * n), nan=0.0).clamp(min=0)
    voxel = torch.minimum(voxel, (n - 1).to(voxel)).long()
    return march.occupancy[voxel[..., 0], voxel[..., 1], voxel[..., 2]] != 0


def _interpolate(
    plane: Float[Tensor, "v u c"], x: Float[Tensor, " samples"], y: Float[Tensor, " samples"]
) -> Float[Tensor, "samples c"]:
    """Interpolates bilinearly, clamped at the border, with lattice points on it (align_corners)."""
    grid = torch.stack([x, y], dim=-1)
    is_nan = torch.isnan(grid)  # which grid_sample takes for -1, and its gradient out of bounds
    image = plane.permute(2, 0, 1)[None]
    values = functional.grid_sample(
        image,
        grid.masked_fill(is_nan, 0)[None, :, None],
        mode="bilinear",
        padding_mode="border",
        align_corners=True,
    )
    return torch.where(is_nan.any(dim=1)[:, None], torch.nan, values[0, :, :, 0].T)
