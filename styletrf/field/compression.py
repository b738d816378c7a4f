"""Makes a finished field smaller: crops empty margins, and cuts ranks of the density.

Margins always go. Ranks go while the loss on a fixed sample of the photographs' pixels rises by no
more than a given fraction. For an axis pair the density's components are the sum of plane_c (u, v)
line_c (w), a matrix of uv x w in two factors. Its singular value decomposition turns them into as
many components of which each holds the most that is left (Eckart and Young 1936): the last hardly
count. They go in fours, which the kernels read at a time. The appearance's are distinguished by the
basis, and stay.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from styletrf.field.radiance_field import RadianceField, set_occupancy
from styletrf.field.tensor_vm import LINE_AXES, PLANE_AXES, TensorVM
from styletrf.geometry.space import Bounds

LossOf = Callable[[RadianceField], float]

_BLOCK = 4
_MARGIN = 2  # lattice points, after the ends of the occupied part were rounded down


@dataclass(frozen=True, slots=True)
class Compression:
    """The outcome of a compression: losses are mean squared errors, parameters are counted."""

    parameters_before: int
    parameters_after: int
    loss_before: float
    loss_after: float
    density_ranks: tuple[int, ...]
    resolution: tuple[int, int, int]


@torch.no_grad()
def compress(field: RadianceField, loss_of: LossOf, most_rise: float) -> Compression:
    """Makes the field smaller in place and returns by how much.

    Args:
        field: The field, whose occupancy is settled.
        loss_of: Returns the loss of a field.
        most_rise: The most that the loss may rise, as a fraction of it.
    """
    before, parameters_before = loss_of(field), _parameters(field)
    crop_to_occupied(field)
    ordered, singular = svd_factors(field.density.factors)
    cuts = _cuts(singular)
    fewest, most = 0, len(cuts)
    while fewest < most:  # bisection: the most blocks that can go
        middle = (fewest + most + 1) // 2
        field.density.factors = _cut(ordered, cuts[:middle])
        if loss_of(field) <= (1 + most_rise) * before:
            fewest = middle
        else:
            most = middle - 1
    field.density.factors = _cut(ordered, cuts[:fewest])
    ranks = field.density.factors.ranks
    field.config = replace(field.config, density_ranks=ranks)
    after = _parameters(field)
    return Compression(parameters_before, after, before, loss_of(field), ranks, field.resolution)


def svd_factors(factors: TensorVM) -> tuple[TensorVM, list[Float[Tensor, " _"]]]:
    """Returns factors of the same sums, components by falling singular value, and these values."""
    ranks = [
        min(plane[..., 0].numel(), *line.shape)
        for plane, line in zip(factors.planes, factors.lines, strict=True)
    ]
    result, singular = TensorVM(factors.resolution, ranks), []
    for pair, (plane, line) in enumerate(zip(factors.planes, factors.lines, strict=True)):
        on_plane, in_plane = torch.linalg.qr(plane.detach().flatten(0, 1).double())
        on_line, in_line = torch.linalg.qr(line.detach().double())
        left, values, right = torch.linalg.svd(in_plane @ in_line.T, full_matrices=False)
        root = values.sqrt()
        flat = on_plane @ left * root
        result.planes[pair] = nn.Parameter(flat.reshape(*plane.shape[:2], -1).to(plane))
        result.lines[pair] = nn.Parameter((on_line @ right.T * root).to(line))
        singular.append(values)
    return result, singular


def _cuts(singular: Sequence[Float[Tensor, " _"]]) -> list[int]:
    """Returns the axis pairs in the order in which they lose blocks, the least first."""
    found = [
        (float(values[first : first + _BLOCK].square().sum()), pair)
        for pair, values in enumerate(singular)
        for first in range(_BLOCK, len(values), _BLOCK)
    ]
    return [pair for _, pair in sorted(found)]


def _cut(ordered: TensorVM, cuts: Sequence[int]) -> TensorVM:
    """Returns the factors without the last blocks of each axis pair: as many as `cuts` names it."""
    kept = [
        min(rank, (math.ceil(rank / _BLOCK) - cuts.count(pair)) * _BLOCK)
        for pair, rank in enumerate(ordered.ranks)
    ]
    result = TensorVM(ordered.resolution, kept)
    for pair, rank in enumerate(kept):
        result.planes[pair] = nn.Parameter(ordered.planes[pair].detach()[..., :rank].contiguous())
        result.lines[pair] = nn.Parameter(ordered.lines[pair].detach()[:, :rank].contiguous())
    return result


def crop_to_occupied(field: RadianceField) -> None:
    """Crops the lattice to the occupied voxels, and sets the field's new bounds.

    About them stay 2 to 3 lattice points at the lower ends, and 1 to 2 at the upper ones. Renders
    keep their colors, and depths but those of faint pixels: see `styletrf.field.rendering`.
    """
    occupied = field.density.occupancy
    resolution, lower, upper = field.resolution, [], []
    for axis, n in enumerate(resolution):
        others = [other for other in range(3) if other != axis]
        along = occupied.amax(dim=others).nonzero()[:, 0]
        first, last = int(along.min()), int(along.max()) + 1
        voxels = occupied.shape[axis]
        lower.append(max(0, int(first / voxels * (n - 1)) - _MARGIN))
        upper.append(min(n - 1, int(last / voxels * (n - 1)) + _MARGIN))
    for half in (field.density, field.appearance):
        half.factors = _cropped(half.factors, lower, upper)
    field.bounds = Bounds(*(_within(field.bounds, ends, resolution) for ends in (lower, upper)))
    set_occupancy(field.density, _cropped_occupancy(occupied, lower, upper, resolution))


def _within(
    bounds: Bounds, ends: Sequence[int], resolution: Sequence[int]
) -> tuple[float, float, float]:
    x, y, z = (
        low + (high - low) * end / (n - 1)
        for low, high, end, n in zip(bounds.lower, bounds.upper, ends, resolution, strict=True)
    )
    return x, y, z


def _cropped(factors: TensorVM, lower: Sequence[int], upper: Sequence[int]) -> TensorVM:
    part = [slice(low, high + 1) for low, high in zip(lower, upper, strict=True)]
    sides = [high + 1 - low for low, high in zip(lower, upper, strict=True)]
    result = TensorVM(sides, factors.ranks)
    for k, ((u, v), w) in enumerate(zip(PLANE_AXES, LINE_AXES, strict=True)):
        result.planes[k] = nn.Parameter(factors.planes[k].detach()[part[v], part[u]].contiguous())
        result.lines[k] = nn.Parameter(factors.lines[k].detach()[part[w]].contiguous())
    return result


def _cropped_occupancy(
    occupied: Tensor, lower: Sequence[int], upper: Sequence[int], resolution: Sequence[int]
) -> Tensor:
    """Returns as many voxels of the cropped grid: each is occupied if it meets one that was."""
    result = occupied
    for axis, n in enumerate(resolution):
        voxels = occupied.shape[axis]
        low, high = (end * voxels / (n - 1) for end in (lower[axis], upper[axis]))
        edges = torch.linspace(low, high, voxels + 1, device=occupied.device)
        first = edges[:-1].floor().long().clamp(0, voxels - 1)
        last = (edges[1:].ceil().long() - 1).clamp(0, voxels - 1)
        result = torch.maximum(result.index_select(axis, first), result.index_select(axis, last))
    return result


def _parameters(field: RadianceField) -> int:
    return sum(parameter.numel() for parameter in field.parameters())
