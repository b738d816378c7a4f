"""Finds the tensor that stopped being finite first, when a fit breaks down.

A running fit looks at its loss only. Once that is not finite, the stages are gone through in the
order in which they cause each other; Adam's moments contain past gradients.
"""

from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.field.appearance import Appearance
from styletrf.field.kernels import Kernels, RaySegments, Samples
from styletrf.field.radiance_field import RadianceField
from styletrf.field.ray_cache import RayBatch


@torch.no_grad()
def iteration_stages(
    field: RadianceField,
    kernels: Kernels,
    segments: RaySegments,
    samples: Samples,
    color: Float[Tensor, "rays 3"],
) -> Iterator[tuple[str, Tensor]]:
    """Yields the tensors of an iteration, in order; density and features are computed again."""
    for name in ("origins", "directions", "lengths", "view_directions"):
        yield f"{name} of rays", getattr(segments, name)
    yield "density", kernels.density(field.density.factors, samples.positions)
    yield "weights", samples.weights
    yield "features", kernels.features(field.appearance.factors, samples.positions)
    yield "color", color


@torch.no_grad()
def batch_stages(
    appearance: Appearance, kernels: Kernels, batch: RayBatch
) -> Iterator[tuple[str, Tensor]]:
    """Yields the tensors of a batch of cached rays, and those an appearance computes of it."""
    yield "positions of samples", batch.samples.positions
    yield "weights of samples", batch.samples.weights
    yield "opacity of rays", batch.opacity
    yield "features", appearance.components(batch.samples.positions, kernels)
    yield "color", batch.color(appearance, kernels)
