"""The state of a fit as a checkpoint that a killed one goes on from, to the same parameters."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from torch import Tensor

from styletrf.field.radiance_field import set_occupancy
from styletrf.files.checkpoints import (
    load_checkpoint,
    optimizer_tensors,
    restore_optimizer,
    save_checkpoint,
)

if TYPE_CHECKING:
    from styletrf.field.training.trainer import FieldTrainer

_COUNTERS = (
    "iteration", "iterations", "batch", "next_member", "seconds", "smooth_mse", "stage_start",
    "aside_psnr",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """One row of the training curve."""

    iteration: int
    seconds: float
    psnr: float
    voxels: int
    density_samples: float  # a ray
    color_samples: float  # a ray


def save_fit(folder: Path, trainer: "FieldTrainer") -> None:
    """Writes a checkpoint."""
    tensors = {f"field.{name}": value for name, value in trainer.field.state_dict().items()}
    tensors |= {f"average.{name}": value for name, value in trainer.average.mean.items()}
    tensors |= optimizer_tensors(trainer.optimizer)
    tensors["generator"] = trainer.generator.get_state()
    state = {name: getattr(trainer, name) for name in _COUNTERS}
    curve = [asdict(point) for point in trainer.curve]
    state |= {"averaged": trainer.average.count, "curve": curve}
    save_checkpoint(folder, tensors, state)


def restore_fit(folder: Path, trainer: "FieldTrainer") -> None:
    """Goes on from the checkpoint in `folder`, if there is one."""
    checkpoint = load_checkpoint(folder, trainer.images.device)
    if checkpoint is None:
        return
    tensors, state = checkpoint
    trainer.iteration = state["stage_start"]
    trainer.field.upsample(
        [tensors[f"field.density.factors.lines.{k}"].shape[0] for k in (2, 1, 0)]
    )
    trainer.begin_stage()
    field = _without_prefix("field.", tensors)
    set_occupancy(trainer.field.density, field["density.occupancy"])
    trainer.field.load_state_dict(field)
    restore_optimizer(trainer.optimizer, tensors)
    trainer.average.mean = _without_prefix("average.", tensors)
    trainer.average.count = state["averaged"]
    trainer.generator.set_state(tensors["generator"].cpu())
    for name in _COUNTERS:
        setattr(trainer, name, state[name])
    trainer.curve = [CurvePoint(**point) for point in state["curve"]]


def _without_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Returns the tensors whose names begin with it."""
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
