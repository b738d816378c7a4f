"""The hot loops of the field, in forms that all pass one conformance suite.

`kernels_for(device)` gives the fastest form for a device: numba on the CPU, Triton on a GPU where
it is installed, else the plain-torch reference; a name overrides the choice.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from types import ModuleType

import torch
from torch import Tensor

from styletrf.errors import InputError
from styletrf.kernels import fused, reference
from styletrf.kernels.samples import March, Samples, Segments
from styletrf.tensor_vm import TensorVM

__all__ = ["FORMS", "Kernels", "March", "Samples", "Segments", "kernels_for"]

FORMS = ("reference", "fused", "triton")


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


def kernels_for(device: torch.device, name: str | None = None) -> Kernels:
    """Returns the kernels called `name`, one of `FORMS`, by default the fastest on `device`.

    Raises:
        InputError: No form is called so, or it is `triton` and that is not installed.
    """
    match name or _fastest(device):
        case "reference":
            return _form("reference", reference)
        case "fused":
            return _form("fused", fused)
        case "triton" if _has_triton():
            from styletrf.kernels import triton_form

            return _form("triton", triton_form)
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


def _form(name: str, module: ModuleType) -> Kernels:
    return Kernels(
        name, module.features, module.density, module.trace, module.heavy, module.composite,
        module.decode,
    )  # fmt: skip
