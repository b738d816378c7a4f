"""The state of a style training, in one safetensors file.

Tensors: `network.NAME`, `exp_avg.NAME` and `exp_avg_sq.NAME` (Adam's moments) for every parameter,
and `curve`, a row an iteration in float64 with the columns of `CurveRow`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import astuple, dataclass, field, fields
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from styletrf.files.atomic_write import atomic_write
from styletrf.files.checkpoints import warn_of_unreadable
from styletrf.style.style_network import PaintingNetwork, StyleNetwork

_MOMENTS = ("exp_avg", "exp_avg_sq")


@dataclass(frozen=True, slots=True)
class CurveRow:
    """The loss of one iteration: its weighted terms and their sum."""

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
    curve: list[CurveRow] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """How long it has been trained."""
        return self.curve[-1].seconds if self.curve else 0.0


def new_training(network: PaintingNetwork) -> Training:
    """Returns a training of the network that has not begun; `StyleStep` sets the learning rates.

    The optimizer has a group `normalization` (scales and shifts) where the network tells these
    apart, and a group `other`.
    """
    groups: list[dict[str, object]] = []
    if isinstance(network, StyleNetwork):
        groups.append({"name": "other", "params": list(network.parameters())})
    else:
        styles, shared = network.style_parameters(), network.shared_parameters()
        groups.append({"name": "normalization", "params": list(styles.values())})
        groups.append({"name": "other", "params": list(shared.values())})
    return Training(network.train(), torch.optim.Adam(groups, lr=0.0))


def write_checkpoint(path: Path, training: Training) -> None:
    """Writes the state; a checkpoint that stood there is replaced once the new one is whole."""
    tensors: dict[str, Tensor] = {}
    for name, parameter in training.network.named_parameters():
        tensors[f"network.{name}"] = parameter.detach().contiguous()
        for moment in _MOMENTS:
            if parameter in training.optimizer.state:
                tensors[f"{moment}.{name}"] = training.optimizer.state[parameter][moment]
    rows = [astuple(row) for row in training.curve]
    tensors["curve"] = torch.tensor(rows, dtype=torch.float64).reshape(-1, len(fields(CurveRow)))
    with atomic_write(path) as partial:
        save_file(tensors, partial)


def read_checkpoint(path: Path, training: Training) -> None:
    """Puts the state of a checkpoint into a new training.

    Leaves it as it is where there is no checkpoint, or one that is damaged or of another network:
    the training then starts over, and a warning says why.
    """
    if not path.exists():
        return
    try:
        tensors = load_file(path)
    except (OSError, SafetensorError) as error:
        warn_of_unreadable(path, str(error))
        return
    if not _is_whole(tensors, training):
        warn_of_unreadable(path, "it is of another network, or not whole")
        return
    with torch.no_grad():
        _restore(tensors, training)


def _is_whole(tensors: Mapping[str, Tensor], training: Training) -> bool:
    """Whether all that a restoration reads is there, and of the shape that it has here."""
    curve = tensors.get("curve")
    if curve is None or curve.ndim != 2 or curve.shape[1] != len(fields(CurveRow)):
        return False
    kinds = ("network", *_MOMENTS) if len(curve) else ("network",)
    shapes = {
        f"{kind}.{name}": parameter.shape
        for name, parameter in training.network.named_parameters()
        for kind in kinds
    }
    return all(n in tensors and tensors[n].shape == shape for n, shape in shapes.items())


def _restore(tensors: dict[str, Tensor], training: Training) -> None:
    curve = tensors["curve"].tolist()
    for name, parameter in training.network.named_parameters():
        parameter.copy_(tensors[f"network.{name}"])
        if curve:
            state = {moment: tensors[f"{moment}.{name}"].to(parameter) for moment in _MOMENTS}
            training.optimizer.state[parameter] = {"step": torch.tensor(float(len(curve)))} | state
    training.curve.extend(_curve_row(row) for row in curve)


def _curve_row(row: Iterable[float]) -> CurveRow:
    iteration, *rest = row
    return CurveRow(int(iteration), *rest)
