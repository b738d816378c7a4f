"""Requests for time and accuracy, and the fronts that serve them in the times of a machine."""

import json
import re
from dataclasses import asdict, replace

import pytest
from expected_errors import rejects
from luigi.cmdline_parser import CmdlineParser
from mini_fronts import FAST, FRONT, GOOD, as_there, calibrated, mini, of_presets, twice

from pipeline.canonical import canonical_json
from pipeline.digest import typed_digest
from pipeline.errors import TaskFailure
from styletrf.configuration import configured
from styletrf.errors import InputError
from tasks import StylizedTrajectory
from tasks.machine.local_facts import add_fact
from tasks.planning.kept_choice import choice_for, keep_choice
from tasks.planning.remaining_time import timing_of
from tasks.planning.request_validation import configurations
from tasks.presets.presets import DEFAULT_QUALITY, PRESETS, settings_for
from tasks.presets.quality_choice import SHIPPED, Front, choose, fronts_for, require_reachable
from tasks.presets.quality_request import quality_request

pytestmark = pytest.mark.usefixtures("mini_data")


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


def test_of_points_that_fall_short_alike_a_budget_buys_the_better_one_on_the_other_side():
    """The scene decided, and the poorest style was bought whatever time was left."""
    points = [replace(GOOD, style=name, style_db=db) for name, db in (("least", -9.0), ("", -5.0))]
    request = quality_request("draft", "10min")
    assert choose(request, replace(FRONT, points=points), as_there).point == points[1]


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


@pytest.mark.parametrize("tuning", [{}, {"RadianceField": {"steep_gain_db": 0.0}}])
def test_a_point_of_another_quality_is_made_at_that_and_the_choice_is_remembered(tuning):
    """Fronts around `draft` and `standard` are joined; both have points without a change."""
    calibrated(1.0)
    task, request = mini(budget="400s"), quality_request("draft", "400s")
    best = replace(GOOD, quality="standard", tuning=tuning, seconds=390.0)
    front = replace(FRONT, points=(FAST, replace(GOOD, shortfall_db=0.4), best))
    choice = choose(request, front, lambda f, p: p.seconds if f is front else 1e9)
    assert choice.point == best
    assert task.at_point(choice.front, choice.point).quality == "standard"
    assert "--quality standard" in choice.description
    keep_choice(task, front, choice)
    assert choice_for(task, request, front) == choice
    timing = timing_of(task)
    assert timing(front, best) > timing(front, replace(best, quality="draft"))


@pytest.mark.parametrize(
    "words",
    [{"stylizer": "gatys"}, {"network": "n.pth"}, {"method": "per-frame"}, {"stroke_scale": 2.0},
     {"content_weight": 0.5}],
    ids=lambda words: next(iter(words)),
)  # fmt: skip
def test_options_that_another_stylizer_would_not_obey_exclude_its_points(words, monkeypatch):
    front = replace(FRONT, points=(PAINTED, FAST, GOOD))
    monkeypatch.setattr("tasks.results.bounded_result.fronts_for", lambda *_: [front])
    assert [found.points for found in mini(budget="5min")._fronts()] == [front.points]
    assert [found.points for found in mini(budget="5min", **words)._fronts()] == [[FAST, GOOD]]


def test_a_bound_that_only_points_of_another_stylizer_meet_is_refused_in_one_line(monkeypatch):
    """The front of the scene had such a point as its best, and `--plan` ended in a ValueError."""
    front = replace(FRONT, points=(replace(PAINTED, shortfall_db=0.0), FAST))
    monkeypatch.setattr("tasks.results.bounded_result.fronts_for", lambda *_: [front])
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
         if name not in ("consistency_ratio", "stylizer", "quality")}
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
            preset = settings_for(stage, front.quality_of(point))
            configured(configurations()[stage], {**preset, **settings})


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
