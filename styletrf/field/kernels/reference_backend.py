"""The backend of the kernels that `reference` defines, in torch alone."""

from typing import final

from torch import Tensor

from styletrf.field.kernels import reference
from styletrf.field.kernels.interface import Kernels
from styletrf.field.kernels.samples import March, RaySegments, Samples
from styletrf.field.tensor_vm import TensorVM


@final
class ReferenceKernels(Kernels):
    """The functions of `reference`."""

    name = "reference"

    def features(self, factors: TensorVM, positions: Tensor) -> Tensor:
        """See `Kernels.features`."""
        return reference.features(factors, positions)

    def density(self, factors: TensorVM, positions: Tensor) -> Tensor:
        """See `Kernels.density`."""
        return reference.density(factors, positions)

    def trace(
        self, factors: TensorVM, segments: RaySegments, jitter: Tensor, march: March
    ) -> Samples:
        """See `Kernels.trace`."""
        return reference.trace(factors, segments, jitter, march)

    def prune(self, samples: Samples, threshold: float) -> Samples:
        """See `Kernels.prune`."""
        return reference.prune(samples, threshold)

    def composite(self, samples: Samples, values: Tensor) -> Tensor:
        """See `Kernels.composite`."""
        return reference.composite(samples, values)

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
        return reference.decode(components, of_view, ray, matrix, output, bias)
