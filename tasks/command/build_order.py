"""The order of a command's stages: those first from which the way to the end is longest."""

import functools
from collections.abc import Iterable, Mapping, Sequence

import luigi

from pipeline.execution.cost_history import DEFAULT_SECONDS, cost_history, cost_of_similar
from pipeline.execution.resources import significant
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store
from pipeline.task import StoredTask
from tasks.command.found_records import is_made


@functools.cache
def seconds_to_the_end(root: luigi.Task) -> Mapping[str, float]:
    """Returns, by task_id, the seconds of the longest path from each task to the root.

    The seconds of a task are those of similar earlier builds.
    """
    stages = list(upstream_first(root))
    seconds = _seconds(stages)
    waiting: dict[str, list[str]] = {stage.task_id: [] for stage in stages}
    for stage in stages:
        for upstream in luigi.task.flatten(stage.requires()):  # type: ignore[no-untyped-call]
            waiting[upstream.task_id].append(stage.task_id)

    @functools.cache
    def longest(name: str) -> float:
        return seconds[name] + max(map(longest, waiting[name]), default=0.0)

    return {name: longest(name) for name in waiting}


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
