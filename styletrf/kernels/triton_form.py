"""The kernels for CUDA: Triton behind torch's autograd, float32.

See `reference` for what each function means; the conformance suite holds them equal. Gradients of
the factors are summed in an order that varies from run to run (see `vm_triton`).
"""

from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.kernels import composite_triton, reference, trace_triton, vm_triton
from styletrf.kernels.samples import March, Samples, Segments
from styletrf.tensor_vm import TensorVM


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
    return vm_triton.density_features(positions, [*factors.planes, *factors.lines])


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
    weights = samples.weights.detach()
    return samples.chosen(*composite_triton.heavy_samples(samples.offsets, weights, threshold))


def composite(
    samples: Samples, values: Float[Tensor, "samples channels"]
) -> Float[Tensor, "rays channels"]:
    """See `reference.composite`."""
    result: Tensor = _Composite.apply(  # type: ignore[no-untyped-call]
        samples.offsets, samples.ray, samples.weights, values
    )
    return result


# Two matrix products, which torch hands to the tensor cores: nothing for a kernel to gain.
decode = reference.decode


class _Features(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, positions: Tensor, *factors: Tensor) -> Tensor:
        ctx.save_for_backward(positions, *factors)
        return vm_triton.features_forward(positions, factors)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        positions, *factors = ctx.saved_tensors
        return None, *vm_triton.scatter_gradients(positions, factors, grads[0])


class _Trace(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, segments: Segments, jitter: Tensor, march: March, *factors: Tensor
    ) -> tuple[Tensor, ...]:
        samples, behind, slopes = trace_triton.trace_forward(segments, jitter, march, factors)
        offsets, ray, s = samples.offsets, samples.ray, samples.s
        positions, weights = samples.positions, samples.weights
        ctx.save_for_backward(offsets, positions, weights, behind, slopes, *factors)
        ctx.mark_non_differentiable(offsets, ray, s, positions)
        return offsets, ray, s, positions, weights

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        offsets, positions, weights, behind, slopes, *factors = ctx.saved_tensors
        grad_raw = trace_triton.trace_backward(offsets, weights, behind, slopes, grads[-1])
        n_components = sum(line.shape[1] for line in factors[3:])
        of_components = grad_raw[:, None].expand(-1, n_components)
        return None, None, None, *vm_triton.scatter_gradients(positions, factors, of_components)


class _Composite(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, offsets: Tensor, ray: Tensor, weights: Tensor, values: Tensor) -> Tensor:
        ctx.save_for_backward(ray, weights, values)
        return composite_triton.composite_forward(offsets, weights, values)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        ray, weights, values = ctx.saved_tensors
        return None, None, *composite_triton.composite_backward(ray, weights, values, grads[0])
