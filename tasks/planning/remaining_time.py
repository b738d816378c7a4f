"""Predicts the remaining time of a command here: stages that the store has take no time."""

import json
import math
from collections.abc import Callable
from datetime import datetime
from typing import Any

import luigi

from pipeline.maintenance.task_graph import stored_tasks, upstream_first
from pipeline.task import StoredTask
from styletrf.evaluation.trade_off import Combination
from tasks.command.found_records import found_record, is_made
from tasks.command.sources import begin_of_command, builds_alone
from tasks.machine.calibration import calibration_of_machine
from tasks.planning.artifact_names import ArtifactNames
from tasks.planning.memory_demand import Photographs
from tasks.planning.scene_sizes import sizes_of
from tasks.planning.stage_costs import (
    CostModel,
    ExpectedCost,
    MeasuredSeconds,
    plain_stage,
    reference_costs,
)
from tasks.presets.quality_choice import Choice, Front, Timing


class FoundStages:
    """Which stages are in the store.

    Stages of different settings share most upstream stages; each is looked up once.
    """

    def __init__(self) -> None:
        self._found: dict[str, bool] = {}
        self._names = ArtifactNames()

    def has(self, stage: StoredTask) -> bool:
        """Returns whether the stage's artifact exists."""
        name = self._names.of(stage)
        if name not in self._found:
            self._found[name] = is_made(stage)
        return self._found[name]


def stages_to_make(root: luigi.Task, is_found: Callable[[StoredTask], bool]) -> list[StoredTask]:
    """Returns the stages that Luigi would build: the root and those upstream that are not found."""
    return list(stored_tasks(root, is_left_out=is_found))


def cost_model(task: Any, front: Front | None = None) -> CostModel:
    """Returns the model that predicts costs for the scene of a task.

    Where luigid hands stages to several machines, all have to choose alike: times are then those
    of the machine that measured the front, or else of the reference's.

    Args:
        task: A `StylizedTrajectory`.
        front: The front that the settings are chosen from, if any.
    """
    reference, is_alone = reference_costs(), builds_alone()
    alike = front.calibration if front and front.calibration else reference.calibration
    here = calibration_of_machine(task.device) if is_alone else alike
    return CostModel(here, sizes_of((task.scene,)), reference, uses_own_builds=is_alone)


def costs_of(task: Any, choice: Choice | None = None) -> Callable[[StoredTask], ExpectedCost]:
    """Returns a function that predicts the cost of a stage of a task here.

    Args:
        task: A `StylizedTrajectory`.
        choice: The point of a front that the settings are from, whose seconds then count; None if
            the user gave the settings.
    """
    if choice is None:
        return cost_model(task).expected
    return _costs_of_point(cost_model(task, choice.front), choice.front, choice.point)


def _costs_of_point(
    model: CostModel, front: Front, point: Combination
) -> Callable[[StoredTask], ExpectedCost]:
    return lambda stage: model.expected(stage, _measured(front, point, stage))


def timing_of(task: Any) -> Timing:
    """Returns a function that predicts the seconds that the settings of a point take here.

    They are those of the stages that the command has made, and of those that it has yet to make.

    Args:
        task: A `StylizedTrajectory`.
    """
    found, models = FoundStages(), dict[str, CostModel]()
    spent_s = _spent_s(task) if builds_alone() else 0.0
    known: dict[tuple[str, str], float] = {}

    def seconds(front: Front, point: Combination) -> float:
        """Returns the seconds of a point, found once."""
        settings = [front.quality_of(point), point.tuning, point.stylizer]
        name = front.description, json.dumps(settings, sort_keys=True)
        if name in known:
            return known[name]
        model = models.get(front.description) or cost_model(task, front)
        models[front.description] = model
        is_found = found.has if builds_alone() else _never
        stages = stages_to_make(task.at_point(front, point), is_found)
        cost_of = _costs_of_point(model, front, point)
        known[name] = spent_s + math.fsum(cost_of(stage).seconds for stage in stages)
        return known[name]

    return seconds


def _spent_s(task: Any) -> float:
    """Returns the seconds of what this command has made to decide the settings of a task."""
    records = [found_record(stage) for stage in upstream_first(*task.deps()) if task.request]
    costs: list[Any] = [record.provenance for record in records if record]
    made = [c for c in costs if datetime.fromisoformat(c["started"]) >= begin_of_command()]
    return math.fsum(float(cost["seconds"]) for cost in made)


def _measured(front: Front, point: Combination, stage: StoredTask) -> MeasuredSeconds | None:
    """Returns the seconds of such a stage of a point; None if they or the machine are unknown.

    The options of the command, such as the length of the path, are not those of the point.
    """
    quality, point = front.scaled_from or (front.quality_of(point), point)
    seconds = point.stage_seconds.get(stage.task_family)
    if not front.calibration or seconds is None:
        return None
    names = {name: stage.param_kwargs.get(name) for name in ("scene", "style")}
    stylizer = {"stylizer": point.stylizer} if point.stylizer else {}
    plain = plain_stage(type(stage), quality=quality, tuning=point.tuning, **names, **stylizer)
    photographs = Photographs(**front.photographs) if front.photographs else None
    return MeasuredSeconds(seconds, plain, front.calibration, photographs)


def _never(_stage: StoredTask) -> bool:
    return False
