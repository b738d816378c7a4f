"""The plan of a command: `--plan` of StylizedTrajectory and of Grid, which builds nothing.

For each stage: whether its artifact exists or would be built, why, and the cost on this machine.
"""

import heapq
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from pipeline.canonical import Json
from pipeline.maintenance.why import TO_BE_MADE, Explanation, explanations
from pipeline.settings import current_store
from pipeline.task import StoredTask
from tasks.command.build_order import Durations, longest_remaining
from tasks.planning.remaining_time import costs_of, stages_to_make
from tasks.planning.stage_costs import ExpectedCost

CostOf = Callable[[StoredTask], ExpectedCost]
"""Returns the expected cost of a stage."""


@dataclass(frozen=True, slots=True)
class StagePlan:
    """A stage of a plan; `cost` is None if its artifact exists.

    Attributes:
        task: The stage.
        reasons: Why it would be built; empty if its artifact exists.
        cost: The expected cost of the build.
    """

    task: StoredTask
    reasons: Sequence[str]
    cost: ExpectedCost | None


@dataclass(frozen=True, slots=True)
class BuildPlan:
    """The stages of a command, upstream first, and descriptions of chosen settings."""

    stages: Sequence[StagePlan]
    settings: Sequence[str]

    @property
    def to_make(self) -> list[StagePlan]:
        """The stages that would be built."""
        return [stage for stage in self.stages if stage.cost]

    def seconds(self, workers: int, cores: int) -> float:
        """Returns the time with this number of workers.

        The larger of two bounds: the makespan of list scheduling by the longest remaining path, as
        if each worker had the machine to itself; and the CPU time divided by the number of cores.
        """
        if workers == 1:
            return sum(seconds for seconds, _ in self._durations().values())
        cpu_s = sum(stage.cost.cpu_seconds for stage in self.stages if stage.cost)
        return max(makespan(self._durations(), workers), cpu_s / cores)

    def peak_memory_bytes(self, workers: int) -> int:
        """Returns a bound on the memory of the builds of this number of workers together."""
        sizes = {s.task.task_id: s.cost.peak_memory_bytes for s in self.stages if s.cost}
        upstream = {name: waits_for for name, (_, waits_for) in self._durations().items()}
        return most_at_once(sizes, upstream, workers)

    def _durations(self) -> dict[str, tuple[float, list[str]]]:
        """Returns the seconds of each stage to build, and the stages that it waits for."""
        costs = {stage.task.task_id: stage.cost for stage in self.stages if stage.cost}
        upstream = {
            s.task.task_id: [t.task_id for t in s.task.requires().values() if t.task_id in costs]
            for s in self.to_make
        }
        return {name: (cost.seconds, upstream[name]) for name, cost in costs.items()}


def makespan(durations: Durations, workers: int) -> float:
    """Returns the makespan of list scheduling by the longest remaining path (Graham 1969).

    Args:
        durations: The seconds of each task, and the tasks that it waits for.
        workers: How many tasks run at once.
    """
    ahead = longest_remaining(durations)
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


def most_at_once(
    sizes: Mapping[str, int], upstream: Mapping[str, Sequence[str]], workers: int
) -> int:
    """Returns a bound on the sum of the sizes of tasks that can run at once.

    It is exact for two workers. For more it is the largest sum of a task and of the largest others
    that are no larger and independent of it, whether or not they depend on each other.

    Args:
        sizes: The size of each task.
        upstream: The tasks that each waits for, which come before it.
        workers: How many tasks run at once.
    """
    ahead = dict[str, set[str]]()
    for name, waits_for in upstream.items():
        ahead[name] = set(waits_for).union(*(ahead[each] for each in waits_for))
    ordered, most = sorted(sizes, key=sizes.__getitem__, reverse=True), 0
    for place, largest in enumerate(ordered):
        if workers * sizes[largest] <= most:
            break
        others = ordered[place + 1 :]
        free = (n for n in others if n not in ahead[largest] and largest not in ahead[n])
        most = max(most, sizes[largest] + sum(sizes[n] for n in islice(free, workers - 1)))
    return most


def plan_of(root: Any) -> BuildPlan:
    """Returns the plan of a command.

    Args:
        root: A `StylizedTrajectory` or a `Grid`.

    Raises:
        InputError: No settings meet a bound on time or quality.
    """
    planned = [cell.planned() for cell in root.cells()]
    settings = [description for _, description, _ in planned if description]
    why = list(explanations([cell for cell, _, _ in planned], current_store()))
    found = {each.task.task_id for each in why if each.is_found}
    costs: dict[tuple[str, str], CostOf] = {}  # cells of a scene share them
    to_make: dict[str, CostOf] = {}
    for cell, description, choice in planned:
        name = cell.scene, description
        costs[name] = costs.get(name) or costs_of(cell, choice)
        for stage in stages_to_make(cell, lambda stage: stage.task_id in found):
            to_make.setdefault(stage.task_id, costs[name])
    return BuildPlan([_stage(each, to_make) for each in why], settings)


def _stage(why: Explanation, to_make: Mapping[str, CostOf]) -> StagePlan:
    cost_of = to_make.get(why.task.task_id)
    if cost_of is None:
        return StagePlan(why.task, (), None)
    return StagePlan(why.task, list(_reasons(why)), cost_of(why.task))


def _reasons(why: Explanation) -> Iterator[str]:
    """Yields why a stage would be built: parameters, sources and code, then inputs to build."""
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
    "the first of its files": "never made of these files",
    "collected": "its artifact was collected",
}
"""Reasons of stages without a difference, by the state that `explanations` reports."""


def _short(value: Json) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 40 else f"{text[:39]}…"
