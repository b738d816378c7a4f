"""The state of a style training as a checkpoint, from which a killed training continues."""

from dataclasses import astuple, dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from styletrf.files.checkpoints import (
    load_checkpoint,
    optimizer_tensors,
    restore_optimizer,
    save_checkpoint,
    warn_of_unreadable,
)
from styletrf.style.style_network import PaintingNetwork, StyleNetwork

_OLD_NAME = "style_training.safetensors"


@dataclass(frozen=True, slots=True)
class StyleCurvePoint:
    """The loss of one iteration: its weighted terms and their sum. A fit has a PSNR instead."""

    iteration: int  # from 1
    loss: float
    content: float
    style: float
    tv: float
    temporal: float
    color: float
    seconds: float  # of training so far, over all its runs


@dataclass(frozen=True, slots=True)
class Training:
    """All that changes while a style network is trained."""

    network: PaintingNetwork
    optimizer: torch.optim.Adam
    curve: list[StyleCurvePoint] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """The seconds of training so far."""
        return self.curve[-1].seconds if self.curve else 0.0


def new_training(network: PaintingNetwork) -> Training:
    """Returns a training of the network that has not begun; `StyleStep` sets the learning rates.

    The optimizer has a group `normalization` (scales and shifts) where the network
    distinguishes these, and a group `other`.
    """
    groups: list[dict[str, object]] = []
    if isinstance(network, StyleNetwork):
        groups.append({"name": "other", "params": list(network.parameters())})
    else:
        styles, shared = network.style_parameters(), network.shared_parameters()
        groups.append({"name": "normalization", "params": list(styles.values())})
        groups.append({"name": "other", "params": list(shared.values())})
    return Training(network.train(), torch.optim.Adam(groups, lr=0.0))


def write_checkpoint(folder: Path, training: Training) -> None:
    """Writes the state; an earlier checkpoint is replaced once the new one is whole."""
    tensors = _parameters(training.network) | optimizer_tensors(training.optimizer)
    save_checkpoint(folder, tensors, {"curve": [astuple(point) for point in training.curve]})


def read_checkpoint(folder: Path, training: Training) -> None:
    """Puts the state of a checkpoint into a new training.

    The training stays as it is where there is no checkpoint, or one that is damaged, of another
    network or of another version: the training then starts over, and a warning says why.
    """
    checkpoint = load_checkpoint(folder, torch.device("cpu"))
    if checkpoint is None:
        if (folder / _OLD_NAME).exists():
            warn_of_unreadable(folder / _OLD_NAME, "an earlier version wrote it")
        return
    tensors, state = checkpoint
    parameters = _parameters(training.network)
    if any(n not in tensors or tensors[n].shape != p.shape for n, p in parameters.items()):
        warn_of_unreadable(folder, "it is of another network, or not whole")
        return
    try:
        curve = [StyleCurvePoint(*point) for point in state["curve"]]
    except (KeyError, TypeError):
        warn_of_unreadable(folder, "another version wrote it")
        return
    with torch.no_grad():
        for name, parameter in parameters.items():
            parameter.copy_(tensors[name])
    restore_optimizer(training.optimizer, tensors)
    training.curve.extend(curve)


def _parameters(network: PaintingNetwork) -> dict[str, Tensor]:
    return {f"network.{name}": parameter for name, parameter in network.named_parameters()}
