"""The kernels for the CPU: numba, float32.

`differentiable.CompiledBackend` documents the functions. The conformance suite checks that all
backends agree.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels import composite_numba, decode_numba, trace_numba, vm_numba
from styletrf.field.kernels.samples import March, RaySegments, Samples
from styletrf.field.tensor_vm import LINE_AXES, PLANE_AXES

_AXES = tuple((u, v, w) for (u, v), w in zip(PLANE_AXES, LINE_AXES, strict=True))


def density_features(
    positions: Float[Tensor, "samples 3"], factors: Sequence[Tensor]
) -> Float[Tensor, " samples"]:
    """Returns the sum of the features."""
    planes, lines = _arrays(*factors[:3]), _arrays(*factors[3:])
    return torch.from_numpy(trace_numba.density_features(_array(positions), planes, lines))


def features_forward(
    positions: Float[Tensor, "samples 3"], factors: Sequence[Tensor]
) -> Float[Tensor, "samples components"]:
    """Returns plane x line of every component."""
    return torch.from_numpy(vm_numba.features_forward(_array(positions), *_arrays(*factors)))


def scatter_gradients(
    positions: Float[Tensor, "samples 3"],
    factors: Sequence[Tensor],
    grad: Float[Tensor, "samples components"],
) -> list[Tensor]:
    """Returns the factors' gradients; `grad` may be a broadcast view. Rows of 0 cost nothing."""
    shared = grad.stride(1) == 0
    upstream = _array(grad[:, :1] if shared else grad)
    nonzero_rows, offset = vm_numba.nonzero_rows(upstream), 0
    grads = []
    for axes, plane, line in zip(_AXES, factors[:3], factors[3:], strict=True):
        pair = vm_numba.scatter_gradients(
            _array(positions), nonzero_rows, axes, upstream, -1 if shared else offset,
            *_arrays(plane, line),
        )  # fmt: skip
        grads.append([torch.from_numpy(array) for array in pair])
        offset += line.shape[1]
    return [*(plane for plane, _ in grads), *(line for _, line in grads)]


def trace_forward(
    segments: RaySegments, jitter: Float[Tensor, " rays"], march: March, factors: Sequence[Tensor]
) -> tuple[Samples, Sequence[Tensor]]:
    """Returns the samples; and the arguments of their softplus, and the rays' step thickness."""
    chains = _arrays(segments.origins, segments.directions, segments.ends)
    thickness = segments.step_thickness(march.scale)
    n_steps = _array(segments.n_steps)
    loose = trace_numba.trace_forward(
        *chains, _array(thickness), n_steps, *_arrays(jitter, march.occupancy),
        _arrays(*factors[:3]), _arrays(*factors[3:]), np.float32(march.shift),
        np.float32(march.termination),
    )  # fmt: skip
    packed = trace_numba.pack(*chains, n_steps, *loose)
    *samples, shifted = (torch.from_numpy(array) for array in packed)
    return Samples(*samples), (shifted, thickness)


def trace_backward(
    offsets: Int64[Tensor, " rays_and_one"],
    weights: Float[Tensor, " samples"],
    saved: Sequence[Tensor],
    grad: Float[Tensor, " samples"],
) -> Float[Tensor, " samples"]:
    """Returns the gradient of the raw densities from that of the weights."""
    return torch.from_numpy(trace_numba.trace_backward(*_arrays(offsets, weights, *saved, grad)))


def heavy_samples(
    offsets: Int64[Tensor, " rays_and_one"], weights: Float[Tensor, " samples"], threshold: float
) -> tuple[Int64[Tensor, " rays_and_one"], Int64[Tensor, " kept"]]:
    """Returns where each ray's kept samples begin, and which samples those are."""
    starts, index = composite_numba.heavy_samples(*_arrays(offsets, weights), np.float32(threshold))
    return torch.from_numpy(starts), torch.from_numpy(index)


def composite_forward(
    offsets: Int64[Tensor, " rays_and_one"],
    weights: Float[Tensor, " samples"],
    values: Float[Tensor, "samples channels"],
) -> Float[Tensor, "rays channels"]:
    """Returns the weighted sum of the values of each ray's samples."""
    return torch.from_numpy(composite_numba.composite_forward(*_arrays(offsets, weights, values)))


def composite_backward(
    ray: Int64[Tensor, " samples"],
    weights: Float[Tensor, " samples"],
    values: Float[Tensor, "samples channels"],
    grad: Float[Tensor, "rays channels"],
) -> tuple[Float[Tensor, " samples"], Float[Tensor, "samples channels"]]:
    """Returns the gradients of the weights and of the values from that of the sums."""
    gradients = composite_numba.composite_backward(*_arrays(ray, weights, values, grad))
    return torch.from_numpy(gradients[0]), torch.from_numpy(gradients[1])


def decode(
    components: Float[Tensor, "samples inputs"],
    of_view: Float[Tensor, "rays hidden"],
    ray: Int64[Tensor, " samples"],
    matrix: Float[Tensor, "hidden inputs"],
    output: Float[Tensor, "3 hidden"],
    bias: Float[Tensor, " 3"],
) -> Float[Tensor, "samples 3"]:
    """See `reference.decode`."""
    result: Tensor = _Decode.apply(  # type: ignore[no-untyped-call]
        components, of_view, ray, matrix, output, bias
    )
    return result


class _Decode(torch.autograd.Function):
    """See `reference.decode`."""

    @staticmethod
    def forward(ctx: Any, components: Tensor, of_view: Tensor, ray: Tensor, *layers: Tensor) -> Any:
        """Keeps the inputs of the layers, and the colors."""
        matrix, output, bias = layers
        colors = torch.from_numpy(
            decode_numba.decode_forward(*_arrays(components, of_view, ray, matrix.T, output, bias))
        )
        ctx.save_for_backward(components, of_view, ray, matrix, output, colors)
        return colors

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        """Returns the gradients of components, of each view's part, and of the layers."""
        components, of_view, ray, matrix, output, colors = ctx.saved_tensors
        grad = _array(grads[0])
        gradients = decode_numba.decode_backward(
            *_arrays(components, of_view, ray, matrix.T, matrix, output, colors), grad,
            vm_numba.nonzero_rows(grad),
        )  # fmt: skip
        of_components, of_views, *of_layers = (torch.from_numpy(array) for array in gradients)
        return of_components, of_views, None, *of_layers


def _array(tensor: Tensor) -> Any:
    return tensor.detach().contiguous().numpy()


def _arrays(*tensors: Tensor) -> tuple[Any, ...]:
    return tuple(_array(tensor) for tensor in tensors)
