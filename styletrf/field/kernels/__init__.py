"""The hot loops of the field, in forms that all pass one conformance suite.

Enters: factors of a field, and its rays as segments. Leaves: samples with weights, features,
colors, and the gradients of all. Begin with `reference`, which defines what each form computes;
`differentiable` makes a form of forward and backward loops, `reference_form` one of `reference`.

`kernels_for(device)` gives the fastest form for a device: numba on the CPU, Triton on a GPU where
it is installed, else the reference in torch; a name overrides the choice.
"""

from importlib.util import find_spec

import torch

from styletrf.errors import InputError
from styletrf.field.kernels import fused, reference
from styletrf.field.kernels.differentiable import DifferentiableKernels
from styletrf.field.kernels.form import Kernels
from styletrf.field.kernels.reference_form import ReferenceKernels
from styletrf.field.kernels.samples import March, Samples, Segments
from styletrf.field.kernels.sparsification import Sparsification, sparsify_gradient

__all__ = [
    "FORMS",
    "Kernels",
    "March",
    "Samples",
    "Segments",
    "Sparsification",
    "kernels_for",
    "sparsify_gradient",
]

FORMS = ("reference", "fused", "triton")


def kernels_for(device: torch.device, name: str | None = None) -> Kernels:
    """Returns the kernels called `name`, one of `FORMS`, by default the fastest on `device`.

    Raises:
        InputError: No form is called so, or it is `triton` and that is not installed.
    """
    match name or _fastest(device):
        case "reference":
            return ReferenceKernels()
        case "fused":
            return DifferentiableKernels("fused", fused, fused.decode)
        case "triton" if _has_triton():
            from styletrf.field.kernels import triton_form

            # Two matrix products, which torch hands to the tensor cores: nothing to gain.
            return DifferentiableKernels("triton", triton_form, reference.decode)
        case "triton":
            raise InputError("kernels triton", "the package triton is not installed", _REMEDY)
    raise InputError(f"kernels {name}", "there is no such form", f"Choose from {', '.join(FORMS)}")


_REMEDY = "Install it (pip install styletrf[gpu]) or choose the reference"


def _fastest(device: torch.device) -> str:
    if device.type == "cpu":
        return "fused"
    return "triton" if device.type == "cuda" and _has_triton() else "reference"


def _has_triton() -> bool:
    return find_spec("triton") is not None
