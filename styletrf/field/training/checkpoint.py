"""The state of a fit as a checkpoint, from which a killed fit continues to the same parameters."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from torch import Tensor

from styletrf.field.radiance_field import set_occupancy
from styletrf.files.checkpoints import (
    load_checkpoint,
    optimizer_tensors,
    restore_optimizer,
    save_checkpoint,
    warn_of_unreadable,
)

if TYPE_CHECKING:
    from styletrf.field.training.trainer import FieldTrainer


@dataclass(frozen=True, slots=True)
class FieldCurvePoint:
    """One row of the training curve, with the size of a grid that grows while it is fitted.

    The columns of `curve.parquet` are these fields but for the seconds (`write_curve`).
    """

    iteration: int
    seconds: float
    psnr: float
    voxels: int
    density_samples: float  # a ray
    color_samples: float  # a ray


@dataclass(slots=True)
class FitState:
    """The state of a fit after some iterations.

    Attributes:
        end: The iteration at which it ends: the planned one, unless the validation views move it.
        batch: Rays of the next iteration.
        next_member: The place in the order of pixels from which the next batch begins.
        iteration: The iterations that are done.
        stage_start: The iteration at which the grid has grown last.
        seconds: The time that they took.
        smooth_mse: The moving average of the mean squared error of the training rays.
        validation_psnr: The PSNR of the validation views at their last measurement, in dB; or 0.
        curve: The training curve.
    """

    end: int
    batch: int
    next_member: int
    iteration: int = 0
    stage_start: int = 0
    seconds: float = 0.0
    smooth_mse: float = 0.0
    validation_psnr: float = 0.0
    curve: list[FieldCurvePoint] = field(default_factory=list)


def save_fit(folder: Path, trainer: "FieldTrainer") -> None:
    """Writes a checkpoint."""
    tensors = {f"field.{name}": value for name, value in trainer.field.state_dict().items()}
    tensors |= {f"average.{name}": value for name, value in trainer.average.mean.items()}
    tensors |= optimizer_tensors(trainer.optimizer)
    tensors["generator"] = trainer.generator.get_state()
    numbers = {"fit": asdict(trainer.state), "averaged": trainer.average.count}
    save_checkpoint(folder, tensors, numbers)


def restore_fit(folder: Path, trainer: "FieldTrainer") -> None:
    """Restores the checkpoint in `folder`, if there is one of this version.

    The trainer stays as it is where there is no checkpoint, or one that is damaged or of another
    version: the fit then starts over, and a warning says why.
    """
    checkpoint = load_checkpoint(folder, trainer.images.device)
    if checkpoint is None:
        return
    tensors, numbers = checkpoint
    try:
        state, averaged = _state_of(numbers["fit"]), numbers["averaged"]
        _require_tensors(tensors, trainer)
    except (KeyError, TypeError):
        warn_of_unreadable(folder, "another version wrote it")
        return
    trainer.state.iteration = state.stage_start
    trainer.field.upsample(
        [tensors[f"field.density.factors.lines.{k}"].shape[0] for k in (2, 1, 0)]
    )
    trainer.begin_stage()
    parameters = _without_prefix("field.", tensors)
    set_occupancy(trainer.field.density, parameters["density.occupancy"])
    trainer.field.load_state_dict(parameters)
    restore_optimizer(trainer.optimizer, tensors)
    trainer.average.mean = _without_prefix("average.", tensors)
    trainer.average.count = averaged
    trainer.generator.set_state(tensors["generator"].cpu())
    trainer.state = state


def _state_of(values: Mapping[str, Any]) -> FitState:
    """Returns the state that `asdict` wrote; raises KeyError or TypeError if it is another's."""
    if set(values) != {each.name for each in fields(FitState)}:
        raise KeyError("fit")
    curve = [FieldCurvePoint(**point) for point in values["curve"]]
    return FitState(**{**values, "curve": curve})


def _require_tensors(tensors: Mapping[str, Tensor], trainer: "FieldTrainer") -> None:
    """Raises KeyError if the tensors are those of another field; its lattice may be finer."""
    expected = {f"field.{name}" for name in trainer.field.state_dict()}
    if expected != {name for name in tensors if name.startswith("field.")}:
        raise KeyError("field")
    if "generator" not in tensors:
        raise KeyError("generator")


def _without_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """Returns the tensors whose names begin with it."""
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
