"""The hot loops of the field, in forms that all pass one conformance suite.

`kernels_for(device)` gives the fastest form for a device: numba on the CPU, the plain-torch
reference elsewhere; a name overrides the choice.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from styletrf.kernels import fused, reference
from styletrf.kernels.samples import March, Samples, Segments
from styletrf.tensor_vm import TensorVM

__all__ = ["FORMS", "Kernels", "March", "Samples", "Segments", "kernels_for"]


@dataclass(frozen=True, slots=True)
class Kernels:
    """One form of the kernels; `reference` documents each function."""

    name: str
    features: Callable[[TensorVM, Tensor], Tensor]
    density: Callable[[TensorVM, Tensor], Tensor]
    trace: Callable[[TensorVM, Segments, Tensor, March], Samples]
    heavy: Callable[[Samples, float], Samples]
    composite: Callable[[Samples, Tensor], Tensor]
    decode: Callable[[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor], Tensor]


FORMS = {
    module.__name__.rpartition(".")[2]: Kernels(
        module.__name__.rpartition(".")[2],
        module.features,
        module.density,
        module.trace,
        module.heavy,
        module.composite,
        module.decode,
    )
    for module in (reference, fused)
}


def kernels_for(device: torch.device, name: str | None = None) -> Kernels:
    """Returns the kernels called `name`, by default the fastest that run on `device`."""
    return FORMS[name or ("fused" if device.type == "cpu" else "reference")]
