"""The hot loops of the field, in backends that all pass one conformance suite.

Enters: factors of a field, and its rays as segments. Leaves: samples with weights, features,
colors, and the gradients of all. Begin with `reference`, which defines what each backend computes.
`reference_backend` wraps it, and `differentiable` wraps compiled forward and backward loops.

`kernels_for(device)` returns the fastest backend for a device: numba on the CPU, Triton on a GPU if
it is installed, else the reference in torch; a name overrides the choice.
"""

from importlib.util import find_spec

import torch

from styletrf.errors import InputError
from styletrf.field.kernels import numba_backend, reference
from styletrf.field.kernels.differentiable import DifferentiableKernels
from styletrf.field.kernels.interface import Kernels
from styletrf.field.kernels.reference_backend import ReferenceKernels
from styletrf.field.kernels.samples import March, RaySegments, Samples
from styletrf.field.kernels.sparsification import Sparsification, sparsify_gradient

__all__ = [
    "BACKENDS",
    "Kernels",
    "March",
    "RaySegments",
    "Samples",
    "Sparsification",
    "kernels_for",
    "sparsify_gradient",
]

BACKENDS = ("reference", "fused", "triton")


def kernels_for(device: torch.device, name: str | None = None) -> Kernels:
    """Returns the kernels of a backend, one of `BACKENDS`; without a name the fastest on `device`.

    Raises:
        InputError: No backend has this name, or it is `triton` and Triton is not installed.
    """
    match name or _fastest(device):
        case "reference":
            return ReferenceKernels()
        case "fused":
            return DifferentiableKernels("fused", numba_backend, numba_backend.decode)
        case "triton" if _has_triton():
            from styletrf.field.kernels import triton_backend

            # Two matrix products, which torch hands to the tensor cores: nothing to gain.
            return DifferentiableKernels("triton", triton_backend, reference.decode)
        case "triton":
            raise InputError("kernels triton", "the package triton is not installed", _REMEDY)
    raise InputError(
        f"kernels {name}", "there is no such backend", f"Choose from {', '.join(BACKENDS)}"
    )


_REMEDY = "Install it (pip install styletrf[gpu]) or choose the reference"


def _fastest(device: torch.device) -> str:
    if device.type == "cpu":
        return "fused"
    return "triton" if device.type == "cuda" and _has_triton() else "reference"


def _has_triton() -> bool:
    return find_spec("triton") is not None
