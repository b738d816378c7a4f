"""What a command would do: `--plan` of StylizedTrajectory and of Grid.

One line a stage: it is found, or it would be made, why, and what that will take on this machine.
Nothing is built.
"""

import heapq
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.canonical import Json
from pipeline.maintenance.why import TO_BE_MADE, Explanation, explanations
from pipeline.settings import current_store
from pipeline.task import StoredTask
from tasks.remaining_time import cost_model, stages_to_make
from tasks.stage_costs import ExpectedCost


@dataclass(frozen=True, slots=True)
class StagePlan:
    """A stage of a plan; `cost` is None where it is found.

    Attributes:
        task: The stage.
        reasons: Why it would be made; none where it is found.
        cost: What that is expected to take.
    """

    task: StoredTask
    reasons: Sequence[str]
    cost: ExpectedCost | None


@dataclass(frozen=True, slots=True)
class BuildPlan:
    """The stages of a command, upstream first, and the settings that were chosen for it."""

    stages: Sequence[StagePlan]
    settings: Sequence[str]

    @property
    def to_make(self) -> list[StagePlan]:
        """The stages that would be built."""
        return [stage for stage in self.stages if stage.cost]

    def seconds(self, workers: int, cores: int) -> float:
        """Returns how long it takes with so many workers.

        The larger of two bounds: each worker takes the stage that the longest way to the end begins
        with, as if it had the machine to itself; and all CPU time, by the number of cores.
        """
        if workers == 1:
            return sum(seconds for seconds, _ in self._durations().values())
        cpu_s = sum(stage.cost.cpu_seconds for stage in self.stages if stage.cost)
        return max(makespan(self._durations(), workers), cpu_s / cores)

    def _durations(self) -> dict[str, tuple[float, list[str]]]:
        """The seconds of each stage to make, and which of them it waits for."""
        costs = {stage.task.task_id: stage.cost for stage in self.stages if stage.cost}
        upstream = {
            s.task.task_id: [t.task_id for t in s.task.requires().values() if t.task_id in costs]
            for s in self.to_make
        }
        return {name: (cost.seconds, upstream[name]) for name, cost in costs.items()}


def makespan(durations: Mapping[str, tuple[float, Sequence[str]]], workers: int) -> float:
    """Returns when the last task ends if each worker takes the one with the longest way to the end.

    (List scheduling, Graham 1969.)

    Args:
        durations: The seconds of each task, and the tasks that it waits for, which come before it.
        workers: How many tasks run at once.
    """
    ahead = dict.fromkeys(durations, 0.0)
    for name in reversed(list(durations)):
        ahead[name] += durations[name][0]
        for upstream in durations[name][1]:
            ahead[upstream] = max(ahead[upstream], ahead[name])
    running: list[tuple[float, str]] = []
    ended, begun, now = set[str](), set[str](), 0.0
    while len(ended) < len(durations):
        ready = [n for n in durations if n not in begun and ended.issuperset(durations[n][1])]
        for name in sorted(ready, key=ahead.__getitem__, reverse=True)[: workers - len(running)]:
            begun.add(name)
            heapq.heappush(running, (now + durations[name][0], name))
        now, name = heapq.heappop(running)
        ended.add(name)
    return now


def plan_of(root: Any) -> BuildPlan:
    """Returns the plan of a command.

    Args:
        root: A `StylizedTrajectory` or a `Grid`.

    Raises:
        InputError: No settings will do.
    """
    cells, settings = [], []
    for asked in root.cells():
        cell, description = asked.planned()
        cells.append(cell)
        settings += [description] if description else []
    why = list(explanations(cells, current_store()))
    found = {each.task.task_id for each in why if each.is_found}
    to_make: dict[str, Any] = {}
    for cell in cells:
        stages = stages_to_make(cell, lambda stage: stage.task_id in found)
        to_make |= {stage.task_id: cell for stage in stages if stage.task_id not in to_make}
    models = {cell.scene: cost_model(cell) for cell in cells}
    return BuildPlan([_stage(each, to_make, models) for each in why], settings)


def _stage(why: Explanation, to_make: Mapping[str, Any], models: Mapping[str, Any]) -> StagePlan:
    cell = to_make.get(why.task.task_id)
    if cell is None:
        return StagePlan(why.task, (), None)
    return StagePlan(why.task, list(_reasons(why)), models[cell.scene].expected(why.task))


def _reasons(why: Explanation) -> Iterator[str]:
    """Why a stage would be made: parameters, sources and code first, then inputs to be made."""
    waiting = []
    for name, (then, now) in why.differences.items():
        if now == TO_BE_MADE:
            waiting.append(name.removeprefix("inputs."))
        else:
            yield name if then is now is None else f"{name}: {_short(then)} -> {_short(now)}"
    if waiting:
        yield f"inputs to be made: {', '.join(waiting)}"
    elif not why.differences:
        is_waiting = why.state.startswith("waits")
        yield "never made here" if is_waiting else STATES.get(why.state, why.state)


STATES = {
    "the first of its family": "never made here",
    "collected": "its artifact was collected",
}
"""Of a stage that would be made without a difference, by what `explanations` says."""


def _short(value: Json) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 40 else f"{text[:39]}…"
