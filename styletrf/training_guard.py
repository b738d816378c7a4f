"""What stopped being finite first, when a fit breaks down.

A running fit looks at its loss only. Once that is not finite, the stages are gone through in the
order in which they cause each other; Adam's first moments tell of past gradients.
"""

from collections.abc import Iterable, Iterator, Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.cameras import Camera
from styletrf.field import RadianceField
from styletrf.kernels import Kernels, Samples, Segments


def first_not_finite(stages: Iterable[tuple[str, Tensor]]) -> str | None:
    """Returns the name of the first tensor that holds NaN or infinity, None if all are finite."""
    return next((name for name, tensor in stages if not torch.isfinite(tensor).all()), None)


def camera_stages(cameras: Sequence[Camera]) -> Iterator[tuple[str, Tensor]]:
    """Yields the cameras' poses; a ray that is not finite would count as one that misses."""
    for camera in cameras:
        yield f"camera {camera.name}", torch.as_tensor(camera.world_from_camera)


def parameter_stages(
    field: RadianceField, optimizer: torch.optim.Optimizer
) -> Iterator[tuple[str, Tensor]]:
    """Yields what earlier iterations left: mean gradients, then parameters."""
    for name, parameter in field.named_parameters():
        moments = optimizer.state.get(parameter, {})
        if "exp_avg" in moments:
            yield f"gradient of {name}", moments["exp_avg"]
    for name, parameter in field.named_parameters():
        yield f"parameter {name}", parameter.detach()


@torch.no_grad()
def iteration_stages(
    field: RadianceField,
    kernels: Kernels,
    segments: Segments,
    samples: Samples,
    color: Float[Tensor, "rays 3"],
) -> Iterator[tuple[str, Tensor]]:
    """Yields what one iteration computes, in its order; density and features are computed again."""
    for name in ("origins", "directions", "lengths", "view_directions"):
        yield f"{name} of rays", getattr(segments, name)
    yield "density", kernels.density(field.density.factors, samples.positions)
    yield "weights", samples.weights
    yield "features", kernels.features(field.appearance.factors, samples.positions)
    yield "color", color
