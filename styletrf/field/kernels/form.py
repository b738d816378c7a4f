"""What every form of the kernels offers."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.field.kernels.samples import March, Samples, Segments
from styletrf.field.tensor_vm import TensorVM

Decode = Callable[[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor], Tensor]


@dataclass(frozen=True, slots=True)
class Kernels:
    """One form of the kernels; `reference` documents each function."""

    name: str
    features: Callable[[TensorVM, Tensor], Tensor]
    density: Callable[[TensorVM, Tensor], Tensor]
    trace: Callable[[TensorVM, Segments, Tensor, March], Samples]
    prune: Callable[[Samples, float], Samples]
    composite: Callable[[Samples, Tensor], Tensor]
    decode: Decode

    def opacity(self, samples: Samples) -> Float[Tensor, " rays"]:
        """Returns the sum of each ray's weights, differentiable in them."""
        return self.composite(samples, torch.ones_like(samples.weights)[:, None])[:, 0]
