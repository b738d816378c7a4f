"""The longest way to the end goes first."""

import pytest

import tasks
from pipeline.execution.cost_history import Cost, CostSample, record_cost
from pipeline.execution.resources import significant
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store
from tasks.command.build_order import seconds_to_the_end

WORDS = {"quality": "draft", "content": "embedded"}


@pytest.fixture(autouse=True)
def _fresh(monkeypatch, photographs):
    monkeypatch.setenv("STYLETRF_DATA", str(photographs))
    seconds_to_the_end.cache_clear()


def of_family(root, family):
    return [task for task in upstream_first(root) if task.task_family == family]


def took(task, seconds):
    record_cost(current_store(), task.task_family, CostSample(significant(task), Cost(seconds, 1)))


def test_a_stage_has_a_longer_way_than_all_that_wait_for_it():
    grid = tasks.Grid(scenes=["mini", "other"], styles=["p", "q"], **WORDS)
    plan = seconds_to_the_end(grid)
    for task in upstream_first(grid):
        for upstream in task.requires().values() if task is not grid else ():
            assert plan[upstream.task_id] > plan[task.task_id] > 0


def test_the_slow_scene_goes_first():
    grid = tasks.Grid(scenes=["mini", "other"], styles=["p"], **WORDS)
    fast, slow = of_family(grid, "RadianceField")
    took(fast, 60.0)
    took(slow, 600.0)
    plan = seconds_to_the_end(grid)
    assert plan[slow.task_id] - plan[fast.task_id] == pytest.approx(540)
    before = {task.scene: plan[task.task_id] for task in of_family(grid, "CameraPoses")}
    assert before[slow.scene] - before[fast.scene] == pytest.approx(540)


def test_without_a_command_nothing_goes_first():
    assert tasks.Grid(scenes=["mini"], styles=["p"], **WORDS).cells()[0].priority == 0
