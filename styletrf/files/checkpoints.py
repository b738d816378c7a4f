"""One checkpoint file from which a killed training continues: whole, or absent.

Tensors and a JSON of plain numbers lie in one safetensors file, replaced by rename.
"""

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from styletrf.files.atomic_write import atomic_write

_NAME = "checkpoint.safetensors"
_LOGGER = logging.getLogger(__name__)


def save_checkpoint(folder: Path, tensors: Mapping[str, Tensor], state: Mapping[str, Any]) -> None:
    """Replaces the folder's checkpoint; `state` holds values that JSON can."""
    folder.mkdir(parents=True, exist_ok=True)
    contiguous = {name: tensor.detach().contiguous() for name, tensor in tensors.items()}
    with atomic_write(folder / _NAME) as partial:
        save_file(contiguous, partial, metadata={"state": json.dumps(state, sort_keys=True)})


def load_checkpoint(
    folder: Path, device: torch.device
) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """Returns the folder's checkpoint, or None where there is none that can be read.

    A warning names a checkpoint that cannot be read.
    """
    path = folder / _NAME
    if not path.exists():
        return None
    try:
        with safe_open(path, framework="pt", device=str(device)) as file:
            state = json.loads(file.metadata()["state"])
            return {name: file.get_tensor(name) for name in file.keys()}, state  # noqa: SIM118
    except (SafetensorError, OSError, ValueError, KeyError, TypeError) as error:
        warn_of_unreadable(path, str(error))
        return None


def warn_of_unreadable(path: Path, reason: str) -> None:
    """Logs that a training starts over although there is a checkpoint."""
    _LOGGER.warning("%s cannot be read (%s): the training starts over", path, reason)


def optimizer_tensors(optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """Returns the optimizer's state as named tensors."""
    state = optimizer.state_dict()["state"]
    return {
        f"optimizer.{index}.{name}": value
        for index, values in state.items()
        for name, value in values.items()
    }


def restore_optimizer(optimizer: torch.optim.Optimizer, tensors: Mapping[str, Tensor]) -> None:
    """Puts the named tensors of `optimizer_tensors` back."""
    state: dict[int, dict[str, Tensor]] = {}
    for key, value in tensors.items():
        if key.startswith("optimizer."):
            _, index, name = key.split(".", 2)
            # step counters are kept on the CPU, as the optimizer made them
            state.setdefault(int(index), {})[name] = value
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
