"""What became of a requested task."""

from datetime import UTC, datetime, timedelta
from typing import get_args

import pytest
from message_words import mentions

import tasks
from pipeline.errors import TaskFailure
from pipeline.job import write_outcome
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store
from styletrf.errors import InputError
from styletrf.reports.gallery.tile import OUTCOME_LABELS
from tasks.command.outcomes import Outcome, outcome_of_missing


@pytest.mark.parametrize(
    ("kind", "outcome"),
    [("user", "failed"), ("crash", "failed"), ("late", "late"), ("interrupted", "not begun")],
)
def test_a_missing_result_has_the_outcome_of_the_stage_that_it_waits_for(out, kind, outcome):
    result = tasks.StylizedTrajectory(scene="mini", style="p", quality="draft", content="embedded")
    image = next(stage for stage in upstream_first(result) if stage.task_family == "StyleImage")
    write_outcome(current_store().new_log("StyleImage", image.action().key), kind, "why")
    found = outcome_of_missing(result)
    assert found.outcome == outcome
    assert found.stage == (None if outcome == "not begun" else image)
    assert outcome_of_missing(result, datetime.now(UTC) + timedelta(hours=1)).outcome == "not begun"


def test_a_budget_out_of_reach_for_the_space_of_a_scene_is_a_failure(out, monkeypatch):
    """A grid called the cell "not begun", without the reason."""
    result = tasks.StylizedTrajectory(scene="mini", style="p", budget="3min")

    def refused(_self):
        raise InputError("--budget 3min", "is too short", "Give --budget 5min")

    monkeypatch.setattr(tasks.StylizedTrajectory, "requires", lambda _self: {})
    monkeypatch.setattr(tasks.StylizedTrajectory, "_keep_choice", refused)
    with pytest.raises(TaskFailure):
        next(result.run())
    found = outcome_of_missing(result)
    assert found.outcome == "failed"
    assert mentions(found.reason, "--budget 3min", "--budget 5min")


def test_the_gallery_has_a_label_for_every_outcome_without_a_result():
    assert OUTCOME_LABELS.keys() == set(get_args(Outcome)) - {"made", "found"}
