"""The seconds that the points of fronts take: on this machine, for other scenes and options."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest
from mini_fronts import FRONT, GOOD, calibrated, mini

from tasks.machine.calibration import calibration_of_machine
from tasks.planning.remaining_time import cost_model, timing_of
from tasks.planning.stage_costs import MeasuredSeconds, reference_costs
from tasks.planning.stage_work import START_S
from tasks.presets.quality_choice import SHIPPED, fronts_for

pytestmark = pytest.mark.usefixtures("mini_data")


@pytest.mark.parametrize("space", ["ndc", "unbounded", "box"])
def test_the_default_quality_takes_as_long_as_its_own_point_and_longer_than_one_of_a_draft(space):
    """All stages do the same work as those of the point, or most of them more of it."""
    calibrated(1.0)
    task, (front,) = mini(budget="5min"), fronts_for(SHIPPED / "none", space)
    offer, _ = front.offers()
    quality, point = offer.scaled_from
    timing = timing_of(task)
    expected, measured = timing(offer, *offer.points), timing(front, point)
    if quality == "standard":
        assert expected == pytest.approx(measured)
    else:
        assert expected > measured


@pytest.mark.parametrize("space", ["ndc", "unbounded", "box"])
def test_seconds_double_on_a_machine_twice_as_slow(space):

    task, (front,) = mini(budget="5min"), fronts_for(SHIPPED / "none", space)
    seconds = []
    for slower in (1.0, 2.0):
        calibrated(slower)
        calibration_of_machine.cache_clear()
        seconds.append(timing_of(task)(front, front.points[0]))
    assert seconds[1] == pytest.approx(2 * seconds[0])


def test_the_seconds_measured_for_a_front_are_scaled_from_its_own_machine():
    """What the front of a scene has stage by stage goes before the reference."""
    calibrated(1.0)
    reference = reference_costs().calibration
    there = replace(reference, seconds={k: v / 3 for k, v in reference.seconds.items()})
    stages = dict.fromkeys(reference_costs().stages, 10.0)
    front = replace(FRONT, calibration=there, points=(replace(GOOD, stage_seconds=stages),))
    task = mini(budget="5min")
    stage = task.with_settings("draft", {}).requires()["field"]
    measured = MeasuredSeconds(10.0, stage, there, None)
    assert cost_model(task, front).expected(stage, measured).seconds == pytest.approx(30.0)
    families = {s.task_family for s in graph_of(task)}
    assert timing_of(task)(front, front.points[0]) >= 30.0 * len(families & stages.keys())


def test_what_a_command_made_to_decide_its_settings_counts_for_its_budget(monkeypatch):
    """A budget was full again after the camera poses."""
    calibrated(1.0)
    begun = datetime.now(UTC)
    monkeypatch.setattr("tasks.planning.remaining_time.begin_of_command", lambda: begun)
    front = replace(FRONT, calibration=reference_costs().calibration)

    def seconds(started: datetime) -> float:
        record = SimpleNamespace(provenance={"started": started.isoformat(), "seconds": 50.0})
        monkeypatch.setattr(
            "tasks.planning.remaining_time.found_record",
            lambda stage: record if stage.task_family == "CameraPoses" else None,
        )
        return timing_of(mini(budget="5min"))(front, GOOD)

    earlier, now = (seconds(begun + timedelta(seconds=each)) for each in (-1.0, 1.0))
    assert now == pytest.approx(earlier + 50.0)


def test_the_seconds_of_another_scene_are_scaled_by_its_photographs():
    """A front of 62 small photographs promised its own seconds to any capture."""
    calibrated(1.0)
    stages = {"TrajectoryFrames": 10.0 + START_S, "SceneModel": 10.0 + START_S}
    front = replace(FRONT, calibration=reference_costs().calibration)

    def seconds(**photographs: int) -> float:
        point = replace(GOOD, stage_seconds=stages)
        known = replace(front, photographs=photographs, points=(point,))
        return timing_of(mini(budget="5min"))(known, point)

    alike = seconds()  # the scene has eight photographs of 96 x 96 pixels
    assert seconds(count=8, width=96, height=96) == pytest.approx(alike)
    assert seconds(count=16, width=96, height=96) == pytest.approx(alike - 5.0)
    assert seconds(count=8, width=96, height=48) == pytest.approx(alike + 10.0)


@pytest.mark.parametrize(
    ("words", "times"), [({"seconds": 10.0}, 4), ({"frame_size": 192}, 4), ({"frame_rate": 30}, 1)]
)
def test_a_longer_path_and_larger_frames_take_more_than_those_of_the_front(words, times):
    """Both stages had the options of the command, so that these took no time."""
    calibrated(1.0)
    stages = {"TrajectoryFrames": 10.0 + START_S, "StylizedFrames": 20.0 + START_S}
    front = replace(
        FRONT,
        calibration=reference_costs().calibration,
        photographs={"count": 8, "width": 96, "height": 96},
        points=(replace(GOOD, stage_seconds=stages),),
    )
    only = {**dict.fromkeys(reference_costs().stages, START_S), **stages}
    point = replace(GOOD, stage_seconds=only)
    plain, more = (timing_of(mini(budget="5min", **each))(front, point) for each in ({}, words))
    assert more - plain == pytest.approx((times - 1) * 30.0)


def test_the_seconds_of_a_front_are_not_those_of_another_strategy():
    calibrated(1.0)
    front = replace(FRONT, calibration=reference_costs().calibration)
    known, unknown = (
        timing_of(mini(budget="5min", strategy="s1"))(front, replace(GOOD, stage_seconds=stages))
        for stages in ({"StylizedField": 9999.0}, {})
    )
    assert known == unknown


def graph_of(task):
    from pipeline.maintenance.task_graph import upstream_first

    return upstream_first(task.with_settings("draft", {}))
