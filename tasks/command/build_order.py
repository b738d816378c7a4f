"""The order of a command's stages: those first from which the way to the end is longest."""

import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import luigi

from pipeline.execution.cost_history import DEFAULT_SECONDS, cost_history, cost_of_similar
from pipeline.execution.resources import significant
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store
from pipeline.task import StoredTask
from tasks.command.found_records import is_made

Durations: TypeAlias = Mapping[str, tuple[float, Sequence[str]]]
"""The seconds of each task, and the tasks that it waits for, which come before it."""


@functools.cache
def seconds_to_the_end(root: luigi.Task) -> Mapping[str, float]:
    """Returns, by task_id, the seconds of the longest path from each task to the root.

    The seconds of a task are those of similar earlier builds.
    """
    stages = list(upstream_first(root))
    seconds = _seconds(stages)
    durations = {
        stage.task_id: (seconds[stage.task_id], [each.task_id for each in stage.deps()])  # type: ignore[no-untyped-call]
        for stage in stages
    }
    return longest_remaining(durations)


def longest_remaining(durations: Durations) -> dict[str, float]:
    """Returns the seconds of the longest path from each task, with itself, to the end."""
    remaining = dict.fromkeys(durations, 0.0)
    for name in reversed(list(durations)):
        seconds, upstream = durations[name]
        remaining[name] += seconds
        for each in upstream:
            remaining[each] = max(remaining[each], remaining[name])
    return remaining


def seconds_ahead(stages: Iterable[luigi.Task]) -> float:
    """Returns how long those of the stages will take together that are not made yet."""
    to_make = [s for s in stages if isinstance(s, StoredTask) and not is_made(s)]
    return sum(_seconds(to_make).values())


def _seconds(stages: Sequence[luigi.Task]) -> dict[str, float]:
    store = current_store()
    earlier = {family: cost_history(store, family) for family in {s.task_family for s in stages}}
    expected_s: dict[str, float] = {}
    for stage in stages:
        cost = None
        if isinstance(stage, StoredTask):
            cost = cost_of_similar(earlier[stage.task_family], significant(stage))
        expected_s[stage.task_id] = cost.seconds if cost else DEFAULT_SECONDS
    return expected_s
