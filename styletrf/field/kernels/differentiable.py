"""The kernels of a backend as functions of torch's autograd.

Factors receive gradients from their features and from the weights of a march. Compositing passes
gradients to weights and values. Positions are constants.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, final, runtime_checkable

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels.interface import Kernels
from styletrf.field.kernels.samples import March, RaySegments, Samples
from styletrf.field.kernels.sparsification import sparsified
from styletrf.field.tensor_vm import TensorVM

Decode = Callable[[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor], Tensor]


@runtime_checkable
class CompiledBackend(Protocol):
    """A module with plain functions of tensors; `factors` are three planes and three lines."""

    def density_features(
        self, positions: Float[Tensor, "samples 3"], factors: Sequence[Tensor]
    ) -> Float[Tensor, " samples"]:
        """Returns the sum of the features."""

    def features_forward(
        self, positions: Float[Tensor, "samples 3"], factors: Sequence[Tensor]
    ) -> Float[Tensor, "samples components"]:
        """Returns plane x line of every component."""

    def scatter_gradients(
        self,
        positions: Float[Tensor, "samples 3"],
        factors: Sequence[Tensor],
        grad: Float[Tensor, "samples components"],
    ) -> list[Tensor]:
        """Returns the factors' gradients; rows of 0 cost nothing. `grad` may be broadcast."""

    def trace_forward(
        self,
        segments: RaySegments,
        jitter: Float[Tensor, " rays"],
        march: March,
        factors: Sequence[Tensor],
    ) -> tuple[Samples, Sequence[Tensor]]:
        """Returns the samples, and further tensors that `trace_backward` needs."""

    def trace_backward(
        self,
        offsets: Int64[Tensor, " rays_and_one"],
        weights: Float[Tensor, " samples"],
        saved: Sequence[Tensor],
        grad: Float[Tensor, " samples"],
    ) -> Float[Tensor, " samples"]:
        """Returns the gradient of the raw densities from that of the weights."""

    def heavy_samples(
        self,
        offsets: Int64[Tensor, " rays_and_one"],
        weights: Float[Tensor, " samples"],
        threshold: float,
    ) -> tuple[Int64[Tensor, " rays_and_one"], Int64[Tensor, " kept"]]:
        """Returns the first index of each ray's kept samples, and the indices of kept samples."""

    def composite_forward(
        self,
        offsets: Int64[Tensor, " rays_and_one"],
        weights: Float[Tensor, " samples"],
        values: Float[Tensor, "samples channels"],
    ) -> Float[Tensor, "rays channels"]:
        """Returns the weighted sum of the values of each ray's samples."""

    def composite_backward(
        self,
        ray: Int64[Tensor, " samples"],
        weights: Float[Tensor, " samples"],
        values: Float[Tensor, "samples channels"],
        grad: Float[Tensor, "rays channels"],
    ) -> tuple[Float[Tensor, " samples"], Float[Tensor, "samples channels"]]:
        """Returns the gradients of the weights and of the values from that of the sums."""


@final
@dataclass(frozen=True, slots=True)
class DifferentiableKernels(Kernels):
    """The backend that uses compiled loops; its `decode` is differentiable by itself."""

    name: str
    backend: CompiledBackend
    decoder: Decode

    def features(self, factors: TensorVM, positions: Tensor) -> Tensor:
        """See `Kernels.features`."""
        result: Tensor = _Features.apply(  # type: ignore[no-untyped-call]
            self.backend, positions, *factors.planes, *factors.lines
        )
        return result

    def density(self, factors: TensorVM, positions: Tensor) -> Tensor:
        """See `Kernels.density`."""
        return self.backend.density_features(positions, [*factors.planes, *factors.lines])

    def trace(
        self, factors: TensorVM, segments: RaySegments, jitter: Tensor, march: March
    ) -> Samples:
        """See `Kernels.trace`."""
        samples = _Trace.apply(  # type: ignore[no-untyped-call]
            self.backend, segments, jitter, march, *factors.planes, *factors.lines
        )
        return Samples(*samples)

    def prune(self, samples: Samples, threshold: float) -> Samples:
        """See `Kernels.prune`."""
        weights = samples.weights.detach()
        return samples.chosen(*self.backend.heavy_samples(samples.offsets, weights, threshold))

    def composite(self, samples: Samples, values: Tensor) -> Tensor:
        """See `Kernels.composite`."""
        result: Tensor = _Composite.apply(  # type: ignore[no-untyped-call]
            self.backend, samples.offsets, samples.ray, samples.weights, values
        )
        return result

    def decode(
        self,
        components: Tensor,
        of_view: Tensor,
        ray: Tensor,
        matrix: Tensor,
        output: Tensor,
        bias: Tensor,
    ) -> Tensor:
        """See `Kernels.decode`."""
        return self.decoder(components, of_view, ray, matrix, output, bias)


class _Features(torch.autograd.Function):
    """See `reference.features`."""

    @staticmethod
    def forward(ctx: Any, backend: CompiledBackend, positions: Tensor, *factors: Tensor) -> Tensor:
        """Keeps the positions and the factors."""
        ctx.backend = backend
        ctx.save_for_backward(positions, *factors)
        return backend.features_forward(positions, factors)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        """Adds up the factors' gradients; positions are constants."""
        positions, *factors = ctx.saved_tensors
        return None, None, *ctx.backend.scatter_gradients(positions, factors, grads[0])


class _Trace(torch.autograd.Function):
    """See `reference.trace`."""

    @staticmethod
    def forward(
        ctx: Any,
        backend: CompiledBackend,
        segments: RaySegments,
        jitter: Tensor,
        march: March,
        *factors: Tensor,
    ) -> tuple[Tensor, ...]:
        """Returns the fields of `Samples`; only the weights are differentiable."""
        samples, saved = backend.trace_forward(segments, jitter, march, factors)
        offsets, ray, s = samples.offsets, samples.ray, samples.s
        positions, weights = samples.positions, samples.weights
        ctx.backend, ctx.sparsification = backend, march.sparsification
        ctx.save_for_backward(offsets, positions, weights, *factors, *saved)
        ctx.mark_non_differentiable(offsets, ray, s, positions)
        return offsets, ray, s, positions, weights

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        """Thins the gradient of the raw densities and adds up that of the factors."""
        offsets, positions, weights, *others = ctx.saved_tensors
        factors, saved = others[:6], others[6:]
        grad = ctx.backend.trace_backward(offsets, weights, saved, grads[-1])
        grad = sparsified(grad[:, None], ctx.sparsification)
        of_components = grad.expand(-1, sum(line.shape[1] for line in factors[3:]))
        of_factors = ctx.backend.scatter_gradients(positions, factors, of_components)
        return None, None, None, None, *of_factors


class _Composite(torch.autograd.Function):
    """See `reference.composite`."""

    @staticmethod
    def forward(
        ctx: Any,
        backend: CompiledBackend,
        offsets: Tensor,
        ray: Tensor,
        weights: Tensor,
        values: Tensor,
    ) -> Tensor:
        """Keeps the weights and the values."""
        ctx.backend = backend
        ctx.save_for_backward(ray, weights, values)
        return backend.composite_forward(offsets, weights, values)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        """Returns the gradients of the weights and of the values."""
        ray, weights, values = ctx.saved_tensors
        gradients = ctx.backend.composite_backward(ray, weights, values, grads[0])
        return None, None, None, *gradients
