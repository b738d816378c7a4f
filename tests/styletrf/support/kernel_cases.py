"""Rays and factors to try the kernels on, on torch's default device."""

import copy
from dataclasses import fields, replace

import torch
from torch import Tensor

from styletrf.field.kernels import March, RaySegments, Samples, kernels_for
from styletrf.field.tensor_vm import TensorVM

REFERENCE = kernels_for(torch.device("cpu"), "reference")


def generator(seed: int) -> torch.Generator:
    return torch.Generator(torch.get_default_device()).manual_seed(seed)


def make_segments(n: int, seed: int, max_steps: int = 40, reach: float = 1.0) -> RaySegments:
    """Segments between random points of the cube of half side `reach`."""
    g = generator(seed)
    origins = reach * (2 * torch.rand(n, 3, generator=g) - 1)
    ends = reach * (2 * torch.rand(n, 3, generator=g) - 1)
    steps = torch.randint(0, max_steps + 1, (n,), generator=g)
    return segments_between(origins, ends, steps)


def segments_between(origins: Tensor, ends: Tensor, n_steps: Tensor | int) -> RaySegments:
    """Rays of one piece each."""
    return chains(
        origins[:, None], (ends - origins)[:, None], torch.ones_like(origins[:, :1]), n_steps
    )


def bent_segments(n: int, seed: int, max_steps: int = 40, reach: float = 1.0) -> RaySegments:
    """Rays along random corners: one piece, two or three, each ending where the next begins."""
    g = generator(seed)
    corners = reach * (2 * torch.rand(n, 4, 3, generator=g) - 1)
    ends = torch.rand(n, 3, generator=g).sort(dim=1).values
    ends[:, -1] = 1.0
    ends[::3, 0] = 1.0  # one piece, the others empty
    ends[1::3, 1] = 1.0
    starts = torch.cat([torch.zeros_like(ends[:, :1]), ends[:, :-1]], dim=1)
    fractions = torch.where(ends > starts, ends - starts, 1.0)[..., None]
    directions = (corners[:, 1:] - corners[:, :-1]) / fractions
    origins = corners[:, :-1] - starts[..., None] * directions
    steps = torch.randint(0, max_steps + 1, (n,), generator=g)
    return chains(origins, directions, ends.cummax(dim=1).values, steps)


def chains(origins: Tensor, directions: Tensor, ends: Tensor, n_steps: Tensor | int) -> RaySegments:
    """Rays of straight pieces, with depths from 1 to 2 on each."""
    n_steps = torch.as_tensor(n_steps).expand(len(origins))
    starts = torch.cat([torch.zeros_like(ends[:, :1]), ends[:, :-1]], dim=1)
    lengths = ((ends - starts) * directions.norm(dim=-1)).sum(dim=1)
    ones = torch.ones_like(ends)
    return RaySegments(
        origins, directions, ends, lengths, n_steps, directions[:, 0], ones, 2 * ones, ones
    )


def with_steps(segments: RaySegments, n_steps: int) -> RaySegments:
    return replace(segments, n_steps=torch.full_like(segments.n_steps, n_steps))


def doubled(segments: RaySegments) -> RaySegments:
    values = [getattr(segments, f.name) for f in fields(segments)]
    return RaySegments(*(v.double() if v.is_floating_point() else v for v in values))


def exact_trace(factors: TensorVM, segments: RaySegments, jitter: Tensor, march: March) -> Samples:
    """The samples by the definition, in float64."""
    wide = copy.deepcopy(factors).double().requires_grad_(requires_grad=False)
    return REFERENCE.trace(wide, doubled(segments), jitter.double(), march)


def constant_factors(raw: float, resolution=(2, 2, 2)) -> TensorVM:
    """Factors of one component that make the raw density `raw` everywhere."""
    factors = TensorVM(resolution, (1, 1, 1), mean=0.0, scale=0.0)
    with torch.no_grad():
        factors.planes[0].fill_(raw)
        factors.lines[0].fill_(1.0)
    return factors


def whole_grid(scale: float = 1.0, shift: float = 0.0, termination: float = 0.0) -> March:
    """A march that passes over nothing."""
    return March(torch.ones(1, 1, 1, dtype=torch.uint8), shift, scale, termination)


def packed(counts: list[int], weights: Tensor) -> Samples:
    """Samples of rays with so many each."""
    counts_of = torch.tensor(counts, dtype=torch.int64)
    offsets = torch.nn.functional.pad(torch.cumsum(counts_of, 0), (1, 0))
    ray = torch.repeat_interleave(counts_of)
    s = torch.arange(len(weights), dtype=weights.dtype)
    return Samples(offsets, ray, s, torch.zeros(len(weights), 3, dtype=weights.dtype), weights)
