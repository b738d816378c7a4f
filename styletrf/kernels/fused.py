"""The kernels for the CPU: numba behind torch's autograd, float32.

See `reference` for what each function means; the conformance suite holds them equal.
"""

from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.kernels import decode_numba, trace_numba, vm_numba
from styletrf.kernels.samples import March, Samples, Segments
from styletrf.tensor_vm import LINE_AXES, PLANE_AXES, TensorVM

_AXES = tuple((u, v, w) for (u, v), w in zip(PLANE_AXES, LINE_AXES, strict=True))


def features(
    factors: TensorVM, positions: Float[Tensor, "samples 3"]
) -> Float[Tensor, "samples components"]:
    """See `reference.features`."""
    result: Tensor = _Features.apply(  # type: ignore[no-untyped-call]
        positions, *factors.planes, *factors.lines
    )
    return result


def density(factors: TensorVM, positions: Float[Tensor, "samples 3"]) -> Float[Tensor, " samples"]:
    """See `reference.density`. No gradient."""
    planes, lines = _arrays(*factors.planes), _arrays(*factors.lines)
    return torch.from_numpy(trace_numba.density_features(_array(positions), planes, lines))


def trace(
    factors: TensorVM, segments: Segments, jitter: Float[Tensor, " rays"], march: March
) -> Samples:
    """See `reference.trace`."""
    samples = _Trace.apply(  # type: ignore[no-untyped-call]
        segments, jitter, march, *factors.planes, *factors.lines
    )
    return Samples(*samples)


def heavy(samples: Samples, threshold: float) -> Samples:
    """See `reference.heavy`."""
    offsets, index = trace_numba.heavy_samples(
        *_arrays(samples.offsets, samples.weights), np.float32(threshold)
    )
    return samples.chosen(torch.from_numpy(offsets), torch.from_numpy(index))


def composite(
    samples: Samples, values: Float[Tensor, "samples channels"]
) -> Float[Tensor, "rays channels"]:
    """See `reference.composite`."""
    result: Tensor = _Composite.apply(  # type: ignore[no-untyped-call]
        samples.offsets, samples.ray, samples.weights, values
    )
    return result


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


class _Features(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, positions: Tensor, *factors: Tensor) -> Tensor:
        ctx.save_for_backward(positions, *factors)
        return torch.from_numpy(vm_numba.features_forward(_array(positions), *_arrays(*factors)))

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        positions, *factors = ctx.saved_tensors
        grad, offset = _array(grads[0]), 0
        grad_planes, grad_lines = [], []
        for axes, plane, line in zip(_AXES, factors[:3], factors[3:], strict=True):
            pair = vm_numba.scatter_gradients(
                _array(positions), axes, grad, offset, _array(plane), _array(line)
            )
            grad_planes.append(torch.from_numpy(pair[0]))
            grad_lines.append(torch.from_numpy(pair[1]))
            offset += line.shape[1]
        return None, *grad_planes, *grad_lines


class _Trace(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, segments: Segments, jitter: Tensor, march: March, *factors: Tensor
    ) -> tuple[Tensor, ...]:
        origins, directions = _arrays(segments.origins, segments.directions)
        lengths, n_steps = _arrays(segments.lengths, segments.n_steps)
        shift, scale = np.float32(march.shift), np.float32(march.scale)
        padded = trace_numba.trace_forward(
            origins, directions, lengths, n_steps, _array(jitter), _array(march.occupancy),
            _arrays(*factors[:3]), _arrays(*factors[3:]), shift, scale,
            np.float32(march.termination),
        )  # fmt: skip
        packed = trace_numba.pack(origins, directions, *padded)
        offsets, ray, s, positions, raw, weights = (torch.from_numpy(array) for array in packed)
        ctx.save_for_backward(offsets, positions, raw, weights, *factors)
        ctx.march = (lengths, n_steps, shift, scale)
        ctx.mark_non_differentiable(offsets, ray, s, positions)
        return offsets, ray, s, positions, weights

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        offsets, positions, raw, weights, *factors = ctx.saved_tensors
        lengths, n_steps, shift, scale = ctx.march
        grad_raw = trace_numba.trace_backward(
            _array(offsets), lengths, n_steps, _array(raw), _array(weights), _array(grads[-1]),
            shift, scale,
        )  # fmt: skip
        grad_planes, grad_lines = [], []
        for axes, plane, line in zip(_AXES, factors[:3], factors[3:], strict=True):
            pair = vm_numba.scatter_gradients(
                _array(positions), axes, grad_raw, -1, _array(plane), _array(line)
            )
            grad_planes.append(torch.from_numpy(pair[0]))
            grad_lines.append(torch.from_numpy(pair[1]))
        return None, None, None, *grad_planes, *grad_lines


class _Composite(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, offsets: Tensor, ray: Tensor, weights: Tensor, values: Tensor) -> Tensor:
        ctx.save_for_backward(ray, weights, values)
        return torch.from_numpy(trace_numba.composite_forward(*_arrays(offsets, weights, values)))

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        ray, weights, values = ctx.saved_tensors
        grad = grads[0][ray]
        grad_weights = (grad * values).sum(dim=-1) if ctx.needs_input_grad[2] else None
        return None, None, grad_weights, weights[:, None] * grad


class _Decode(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, components: Tensor, of_view: Tensor, ray: Tensor, *layers: Tensor) -> Any:
        matrix, output, bias = layers
        colors = torch.from_numpy(
            decode_numba.decode_forward(*_arrays(components, of_view, ray, matrix.T, output, bias))
        )
        ctx.save_for_backward(components, of_view, ray, matrix, output, colors)
        return colors

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        components, of_view, ray, matrix, output, colors = ctx.saved_tensors
        gradients = decode_numba.decode_backward(
            *_arrays(components, of_view, ray, matrix.T, matrix, output, colors, grads[0])
        )
        of_components, of_views, *of_layers = (torch.from_numpy(array) for array in gradients)
        return of_components, of_views, None, *of_layers


def _array(tensor: Tensor) -> Any:
    return tensor.detach().contiguous().numpy()


def _arrays(*tensors: Tensor) -> tuple[Any, ...]:
    return tuple(_array(tensor) for tensor in tensors)
