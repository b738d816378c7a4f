"""Requests for time and accuracy, and the fronts that serve them in the times of a machine."""

import json
import re
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest
from expected_errors import rejects
from luigi.cmdline_parser import CmdlineParser

from pipeline.canonical import canonical_json
from pipeline.digest import typed_digest
from pipeline.errors import TaskFailure
from styletrf.configuration import configured
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Combination
from tasks import StylizedTrajectory
from tasks.machine.calibration import keep_calibration, this_machine
from tasks.machine.local_facts import add_fact
from tasks.planning.kept_choice import choice_for, keep_choice
from tasks.planning.remaining_time import cost_model, timing_of
from tasks.planning.request_validation import configurations
from tasks.planning.stage_costs import MeasuredSeconds, reference_costs
from tasks.planning.stage_work import START_S
from tasks.presets.presets import DEFAULT_QUALITY, PRESETS, settings_for
from tasks.presets.quality_choice import SHIPPED, Front, choose, fronts_for, require_reachable
from tasks.presets.quality_request import quality_request

FAST = Combination(
    "quick", "", {"RadianceField": {"iterations": 9}}, 0.8, 24.0, -5.0, 100.0, 1.0, 0.0, 1, 1
)
GOOD = Combination("", "", {}, 0.0, 24.8, -5.0, 280.0, 1.0, 0.0, 1, 1)
FRONT = Front("the front of this scene (s)", "draft", (FAST, GOOD), None)


def as_there(_front, point):
    """The times of the machine that measured the front."""
    return point.seconds


def twice(front, point):
    return 2 * as_there(front, point)


def calibrated(times_slower: float) -> None:
    """This machine is so many times slower than that of the reference."""
    seconds = reference_costs().calibration.seconds
    slower = {kind: times_slower * value for kind, value in seconds.items()}
    keep_calibration(this_machine(), slower)


@pytest.fixture(autouse=True)
def _data(monkeypatch, photographs, tmp_path):
    from tasks.machine.calibration import calibration_of_machine

    monkeypatch.setenv("STYLETRF_DATA", str(photographs))
    monkeypatch.setenv("STYLETRF_OUT", str(tmp_path / "out"))
    calibration_of_machine.cache_clear()


def mini(**words) -> StylizedTrajectory:
    return StylizedTrajectory(**{"scene": "mini", "style": "p", "content": "embedded"} | words)


@pytest.mark.parametrize(
    ("quality", "budget", "found"),
    [
        ("within 1 dB", "", FAST), ("Within  0.5dB", "", GOOD), ("draft", "5min", GOOD),
        ("standard", "101s", FAST), ("draft", "0.05h", FAST),
    ],
)  # fmt: skip
def test_a_request_is_served_by_the_front(quality, budget, found):
    choice = choose(quality_request(quality, budget), FRONT, as_there)
    assert (choice.point, choice.front) == (found, FRONT)


def of_presets(**seconds: float):
    """The times of points of fronts of these qualities, whatever the point is."""
    return lambda front, _point: seconds[front.quality]


@pytest.mark.parametrize(("budget", "quality"), [("30min", "standard"), ("10min", "draft")])
def test_a_budget_with_time_for_the_default_quality_gets_it_and_says_what_it_is_above(
    budget, quality
):
    """Five hours bought a draft."""
    calibrated(1.0)
    task, timing = mini(budget=budget), of_presets(draft=100.0, standard=900.0)
    choice = choose(task.request, FRONT, timing)
    chosen = task.at_point(choice.front, choice.point)
    assert (chosen.quality, choice.point.seconds) == (quality, timing(choice.front, None))
    assert chosen.tuning == choice.point.tuning == {}, (
        "of the default quality, as of the best point"
    )
    assert FRONT.description in choice.description
    assert f"--quality {quality}" in choice.description
    keep_choice(task, FRONT, choice)
    assert choice_for(task, task.request, FRONT) == choice, "the same command goes on with it"


@pytest.mark.parametrize(("budget", "quality"), [("1125s", "standard"), ("1124s", "draft")])
def test_the_default_quality_has_time_for_a_fit_that_becomes_longer(budget, quality):
    """No prediction knows the quarter by which a fit that improves fast is longer."""
    timing = of_presets(draft=100.0, standard=900.0)
    assert choose(quality_request("standard", budget), FRONT, timing).front.quality == quality


@pytest.mark.parametrize("quality", PRESETS)
def test_no_budget_buys_more_than_the_default_quality(quality):
    """What was swept around it or above has no use for it."""
    front = replace(FRONT, quality=quality)
    found = choose(quality_request("standard", "900h"), front, lambda *_: 1.0).front
    assert found.quality == (DEFAULT_QUALITY if quality == "draft" else quality)


def test_the_default_quality_is_the_one_of_a_command_without_any():
    assert mini().quality == DEFAULT_QUALITY


def test_a_bound_on_quality_is_served_by_the_front_alone():
    choice = choose(quality_request("within 9 dB", ""), FRONT, of_presets(draft=9.0, standard=1.0))
    assert choice.front == FRONT


@pytest.mark.parametrize("space", ["ndc", "unbounded", "box"])
def test_the_default_quality_takes_longer_than_the_point_that_its_time_is_predicted_from(space):
    """All stages of both do the same work, and most of them more of it."""
    calibrated(1.0)
    task, (front,) = mini(budget="5min"), fronts_for(SHIPPED / "none", space)
    offer, _ = front.offers()
    best = min(front.points, key=lambda point: point.shortfall_db)
    timing = timing_of(task)
    assert timing(offer, *offer.points) > timing(front, best)


PAINTED = replace(FAST, style="painted", stylizer="arbitrary", shortfall_db=0.9, seconds=50.0)


def test_a_point_is_made_with_its_stylizer_and_the_choice_is_remembered(monkeypatch):
    calibrated(1.0)
    task, request = mini(budget="60s"), quality_request("draft", "60s")
    front = replace(FRONT, points=(replace(PAINTED, tuning=FAST.tuning), FAST, GOOD))
    choice = choose(request, front, as_there)
    chosen = task.at_point(choice.front, choice.point)
    assert (chosen.stylizer, chosen.budget) == ("arbitrary", "")
    assert "network" not in chosen.requires()
    assert "--stylizer arbitrary" in choice.description
    keep_choice(task, front, choice)
    assert choice_for(task, request, front).point.stylizer == "arbitrary"
    assert task.at_point(FRONT, GOOD).stylizer == task.stylizer


@pytest.mark.parametrize(
    "words",
    [{"stylizer": "gatys"}, {"network": "n.pth"}, {"method": "per-frame"}, {"stroke_scale": 2.0},
     {"content_weight": 0.5}],
    ids=lambda words: next(iter(words)),
)  # fmt: skip
def test_options_that_another_stylizer_would_not_obey_exclude_its_points(words, monkeypatch):
    front = replace(FRONT, points=(PAINTED, FAST, GOOD))
    monkeypatch.setattr("tasks.results.trajectory.fronts_for", lambda *_: [front])
    assert [found.points for found in mini(budget="5min")._fronts()] == [front.points]
    assert [found.points for found in mini(budget="5min", **words)._fronts()] == [[FAST, GOOD]]


def test_a_bound_that_only_points_of_another_stylizer_meet_is_refused_in_one_line(monkeypatch):
    """The front of the scene had such a point as its best, and `--plan` ended in a ValueError."""
    front = replace(FRONT, points=(replace(PAINTED, shortfall_db=0.0), FAST))
    monkeypatch.setattr("tasks.results.trajectory.fronts_for", lambda *_: [front])
    task = mini(quality="within 0.1 dB", stroke_scale=2.0)
    for refused in (task.planned, task.require_reachable):
        with rejects("within 0.1 dB", "no such point"):
            refused()


def test_a_choice_that_an_earlier_version_kept_is_found():
    """Its points had neither consistencies nor stylizers."""
    calibrated(1.0)
    task, request = mini(budget="5min"), quality_request("draft", "5min")
    former = [
        {name: value for name, value in asdict(point).items()
         if name not in ("consistency_ratio", "stylizer")}
        for point in FRONT.points
    ]  # fmt: skip
    fields = {"words": task.to_str_params(only_significant=True), "front": FRONT.description,
              "points": former}  # fmt: skip
    key = typed_digest("choice-v1", canonical_json(fields))
    add_fact("choices", key, {"tuning": FAST.tuning, "seconds": 7.0})
    assert choice_for(task, request, FRONT).point == replace(FAST, seconds=7.0)


def test_on_a_machine_twice_as_slow_a_budget_buys_less():
    request = quality_request("draft", "5min")
    assert choose(request, FRONT, twice).point == replace(FAST, seconds=200.0)


def test_a_quality_by_its_name_is_no_request():
    assert quality_request("draft", "") is None


@pytest.mark.parametrize(("quality", "budget"), [("draft", "soon"), ("within 1 dB", "5min")])
def test_unclear_requests_are_refused(quality, budget):
    with pytest.raises(InputError):
        quality_request(quality, budget)


def test_a_budget_below_the_fastest_names_the_nearest_which_can_be_reached():
    with pytest.raises(InputError) as refused:
        choose(quality_request("draft", "99s"), FRONT, as_there)
    (nearest,) = re.findall(r"--budget (\S+)", refused.value.remedy)
    assert choose(quality_request("draft", nearest), FRONT, as_there).point == FAST


def test_while_the_front_is_unknown_the_fastest_point_of_all_counts():
    slow = Front("another", "draft", (GOOD,), None)
    require_reachable(quality_request("draft", "100s"), [slow, FRONT], as_there)
    with pytest.raises(InputError):
        require_reachable(quality_request("draft", "100s"), [slow], as_there)


def test_a_budget_out_of_reach_is_refused_before_the_first_stage():
    calibrated(1.0)
    task = mini(budget="1s")
    with pytest.raises(InputError) as refused:
        task.require_reachable()
    (nearest,) = re.findall(r"--budget (\S+)", refused.value.remedy)
    mini(budget=nearest).require_reachable()


@pytest.mark.parametrize("space", ["ndc", "unbounded", "box"])
def test_seconds_double_on_a_machine_twice_as_slow(space):
    from tasks.machine.calibration import calibration_of_machine

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


def test_a_choice_that_was_kept_stays_whatever_becomes_faster():
    calibrated(1.0)
    task = mini(budget="5min")
    keep_choice(task, FRONT, choose(task.request, FRONT, lambda _front, _point: 299.0))
    assert choice_for(task, task.request, FRONT).point.tuning == GOOD.tuning
    other = mini(budget="4min")
    keep_choice(other, FRONT, choose(other.request, FRONT, as_there))
    assert choice_for(task, task.request, FRONT).point.seconds == 299.0


@pytest.mark.parametrize("space", ["ndc", "unbounded", "box"])
def test_the_settings_of_the_shipped_fronts_are_known(space):
    (front,) = fronts_for(SHIPPED / "none", space)
    assert choose(quality_request("within 1 dB", ""), front, as_there).front.quality == "draft"
    assert json.loads((SHIPPED / f"{space}.json").read_text())["space"] == space
    for point in front.points:
        for stage, settings in point.tuning.items():
            configured(configurations()[stage], {**settings_for(stage, "draft"), **settings})


def test_the_front_of_the_scene_goes_before_the_shipped(tmp_path):
    where = ("scene", "style", "changes", "measured", "machine", "quality")
    rows = [{"combination": asdict(p), "overlaps": False} for p in FRONT.points]
    path = tmp_path / "front.json"
    path.write_text(json.dumps({**dict.fromkeys(where, "x"), "points": rows}))
    assert [list(f.points) for f in fronts_for(path, "ndc")] == [[FAST, GOOD]]
    assert len(fronts_for(tmp_path / "none", None)) == 3
    with rejects("front", "curved", remedy=["TradeOff"]):
        fronts_for(tmp_path / "none", "curved")


def test_other_words_are_no_quality():
    with pytest.raises(ValueError, match="within reason"):
        StylizedTrajectory(scene="s", style="p", quality="within reason")


@pytest.mark.parametrize(
    "words",
    [
        {"budget": "soon"},
        {"budget": "5min", "quality": "paper"},
        {"budget": "5min", "quality": "within 1 dB"},
        {"budget": "5min", "tuning": {"RadianceField": {"batch": 9}}},
        {"style": "trade-off"},
    ],
)
def test_words_that_do_not_go_together_are_refused(words):
    task = StylizedTrajectory(**{"scene": "s", "style": "p"} | words)
    with pytest.raises(InputError):
        task.validate()
    assert task.resolved() is None
    assert not task.complete()


@pytest.mark.parametrize("quality", PRESETS)
@pytest.mark.parametrize("task", ["StylizedTrajectory", "Grid"])
def test_a_budget_and_a_quality_by_its_name_are_refused_whichever_it_is(task, quality):
    """The default was taken for none, and a draft was made."""
    cell = {"Grid": ["--scenes", '["s"]', "--styles", '["p"]']}
    words = [task, *cell.get(task, ["--scene", "s", "--style", "p"]), "--budget", "10min"]
    for typed in ([], ["--quality", quality]):
        with CmdlineParser.global_instance([*words, *typed]) as command:
            (one,) = command.get_task_obj().cells()
            if not typed:
                one.validate()
                continue
            with rejects(f"--quality {quality} --budget 10min", "twice"):
                one.validate()


def test_settings_of_a_stage_and_a_request_are_refused():
    """The settings that the front chooses would win over them, unseen."""
    words = ["StylizedTrajectory", "--scene", "s", "--style", "p", "--budget", "5min"]
    settings = ["--RadianceField-settings", '{"iterations": 9000}']
    with (
        CmdlineParser.global_instance([*words, *settings]) as command,
        rejects("RadianceField"),
    ):
        command.get_task_obj().validate()


def test_a_result_whose_scene_model_cannot_be_fetched_is_incomplete(monkeypatch):
    """Its copy in the shared store is damaged, for example."""
    monkeypatch.setattr("tasks.presets.quality_choice.is_made", lambda _stage: True)
    task = mini(budget="5min")
    task.choose_settings()
    assert not task.complete()
    with pytest.raises(TaskFailure):
        next(task.run())


def test_a_budget_needs_the_kind_of_scene_and_the_sources(tmp_path, monkeypatch):
    """Content is a source only where there is some."""
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    task = StylizedTrajectory(scene="s", style="p", budget="5min")
    sources = {"SceneCapture", "StyleImage", "PerceptualWeights", "TransferWeights"}
    assert {stage.task_family for stage in task.requires().values()} == {"SceneModel"} | sources
    blended = StylizedTrajectory(scene="s", style="p", budget="5min", blend={"q": 0.3})
    paintings = [s for s in blended.requires().values() if s.task_family == "StyleImage"]
    assert {painting.style for painting in paintings} == {"p", "q"}
    assert task.resolved() is None, "while that is unknown"
    assert task.cells() == [task]
