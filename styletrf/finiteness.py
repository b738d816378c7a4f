"""Stops a stage at the first NaN or infinity, and names the tensor and the input.

Stages check only their outputs, which is cheap. If an output is not finite, its causes are checked
in causal order. Tensors from files are checked once. Infinite depth is sky and allowed.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from styletrf.errors import InputError, NotFiniteError

Named = tuple[str, Tensor | np.ndarray]


def first_not_finite(tensors: Iterable[Named]) -> str | None:
    """Returns the name of the first tensor that holds NaN or infinity, None if all are finite."""
    return next((name for name, tensor in tensors if not _is_finite(tensor)), None)


def require_finite(stage: str, where: str, tensors: Iterable[Named]) -> None:
    """Stops the stage where one of the tensors, causes first, is not finite.

    Raises:
        NotFiniteError: It names the first that is not.
    """
    name = first_not_finite(tensors)
    if name is not None:
        raise NotFiniteError(stage, name, where)


def parameter_stages(
    module: nn.Module, optimizer: torch.optim.Optimizer | None = None
) -> Iterator[Named]:
    """Yields the state that iterations left: mean gradients and their squares, then parameters.

    A gradient above 1e19 has an infinite square, by which Adam divides: its parameter would never
    change again.
    """
    state = {} if optimizer is None else optimizer.state
    for kind, moment in (("gradient", "exp_avg"), ("squared gradient", "exp_avg_sq")):
        for name, parameter in module.named_parameters():
            if moment in state.get(parameter, {}):
                yield f"{kind} of {name}", state[parameter][moment]
    for name, parameter in module.named_parameters():
        yield f"parameter {name}", parameter.detach()


def require_finite_file(path: Path, tensors: Iterable[Named]) -> None:
    """Refuses a file with a tensor that is not finite.

    Raises:
        InputError: It names the file and the first tensor that is not finite.
    """
    name = first_not_finite(tensors)
    if name is not None:
        raise InputError(
            str(path), f"{name} is not finite", "Delete it, and run the task that makes it"
        )


def load_finite(path: Path) -> Mapping[str, Tensor]:
    """Returns the tensors of a safetensors file.

    Raises:
        InputError: One of them is not finite.
    """
    tensors = load_file(path)
    require_finite_file(path, tensors.items())
    return tensors


def _is_finite(tensor: Tensor | np.ndarray) -> bool:
    finite = torch.isfinite(tensor) if isinstance(tensor, Tensor) else np.isfinite(tensor)
    return bool(finite.all())
