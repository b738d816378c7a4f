"""The interface of every backend of the kernels."""

from abc import ABC, abstractmethod
from typing import final

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.field.kernels.samples import March, RaySegments, Samples
from styletrf.field.tensor_vm import TensorVM


class Kernels(ABC):
    """One backend of the kernels. The functions of `reference` document what each method computes.

    Attributes:
        name: One of `BACKENDS`.
    """

    name: str

    @abstractmethod
    def features(
        self, factors: TensorVM, positions: Float[Tensor, "samples 3"]
    ) -> Float[Tensor, "samples components"]:
        """Returns plane x line of every component; see `reference.features`."""

    @abstractmethod
    def density(
        self, factors: TensorVM, positions: Float[Tensor, "samples 3"]
    ) -> Float[Tensor, " samples"]:
        """Returns the raw density; see `reference.density`.

        It is not differentiable in every backend: densities are fitted by the weights of `trace`.
        """

    @abstractmethod
    def trace(
        self,
        factors: TensorVM,
        segments: RaySegments,
        jitter: Float[Tensor, " rays"],
        march: March,
    ) -> Samples:
        """Returns the samples of rays, with their weights; see `reference.trace`."""

    @abstractmethod
    def prune(self, samples: Samples, threshold: float) -> Samples:
        """Returns the samples that are worth a color; see `reference.prune`."""

    @abstractmethod
    def composite(
        self, samples: Samples, values: Float[Tensor, "samples channels"]
    ) -> Float[Tensor, "rays channels"]:
        """Returns the weighted sum of values along each ray; see `reference.composite`."""

    @abstractmethod
    def decode(
        self,
        components: Float[Tensor, "samples inputs"],
        of_view: Float[Tensor, "rays hidden"],
        ray: Int64[Tensor, " samples"],
        matrix: Float[Tensor, "hidden inputs"],
        output: Float[Tensor, "3 hidden"],
        bias: Float[Tensor, " 3"],
    ) -> Float[Tensor, "samples 3"]:
        """Returns the colors of the shading network; see `reference.decode`."""

    @final
    def opacity(self, samples: Samples) -> Float[Tensor, " rays"]:
        """Returns the sum of each ray's weights, differentiable in them."""
        return self.composite(samples, torch.ones_like(samples.weights)[:, None])[:, 0]
