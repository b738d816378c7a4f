"""Wishes for time and accuracy, and the fronts that grant them."""

import json
from dataclasses import asdict

import pytest
from luigi.cmdline_parser import CmdlineParser

from styletrf.configuration import configured
from styletrf.errors import InputError
from styletrf.evaluation.trade_off import Combination
from tasks import StylizedTrajectory
from tasks.checking import configurations
from tasks.choosing import SHIPPED, choose, wish_of
from tasks.qualities import settings_for

FAST = Combination(
    "quick", "", {"RadianceField": {"iterations": 9}}, 0.8, 24.0, -5.0, 100.0, 1.0, 0.0, 1, 1
)
GOOD = Combination("", "", {}, 0.0, 24.8, -5.0, 280.0, 1.0, 0.0, 1, 1)


def front(path, points=(FAST, GOOD)):
    told = {
        "scene": "s",
        "style": "p",
        "quality": "draft",
        "measured": "2026-01-01",
        "machine": "2 cores",
        "changes": "1 of 30 changes",
    }
    rows = [{"combination": asdict(p), "overlaps": False} for p in points]
    path.write_text(json.dumps({**told, "points": rows}))
    return path


@pytest.mark.parametrize(
    ("quality", "budget", "found"),
    [
        ("within 1 dB", "", FAST), ("Within  0.5dB", "", GOOD), ("draft", "5min", GOOD),
        ("standard", "101s", FAST), ("draft", "0.05h", FAST),
    ],
)  # fmt: skip
def test_a_wish_is_granted_by_the_front_of_the_scene(tmp_path, quality, budget, found):
    wish = wish_of(quality, budget)
    assert wish
    choice = choose(wish, front(tmp_path / "front.json"), "ndc")
    assert (choice.point, choice.quality) == (found, "draft")
    assert "this scene (s, p, 1 of 30 changes" in choice.told


def test_a_quality_by_its_name_is_no_wish():
    assert wish_of("draft", "") is None


@pytest.mark.parametrize(
    ("quality", "budget", "told"),
    [
        ("draft", "soon", "is no time"), ("within 1 dB", "5min", "two wishes"),
        ("draft", "1s", "no such point"),
    ],
)  # fmt: skip
def test_what_cannot_be_granted_is_told(tmp_path, quality, budget, told):
    with pytest.raises(InputError, match=told):
        choose(wish_of(quality, budget), front(tmp_path / "front.json"), "ndc")


@pytest.mark.parametrize("space", ["ndc", "unbounded", "box"])
def test_the_shipped_fronts_grant_wishes(tmp_path, space):
    choice = choose(wish_of("within 1 dB", ""), tmp_path / "none", space)
    assert f"shipped front for {space} space" in choice.told
    front = json.loads((SHIPPED / f"{space}.json").read_text())
    assert front["space"] == space
    for point in front["points"]:
        for stage, settings in point["combination"]["tuning"].items():
            usual = settings_for(stage, front["quality"])
            configured(configurations()[stage], {**usual, **settings})


def test_other_words_are_no_quality():
    with pytest.raises(ValueError, match="choice"):
        StylizedTrajectory(scene="s", style="p", quality="within reason")


def test_a_scene_without_a_front_is_told_how_to_have_one(tmp_path):
    with pytest.raises(InputError, match="Run TradeOff on the scene"):
        choose(wish_of("within 1 dB", ""), tmp_path / "none", "curved")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ({"budget": "soon"}, "is no time"),
        ({"budget": "5min", "quality": "paper"}, "ask for settings twice"),
        ({"budget": "5min", "quality": "within 1 dB"}, "two wishes"),
        ({"budget": "5min", "tuning": {"RadianceField": {"batch": 9}}}, "chooses the settings"),
        ({"style": "trade-off"}, "name of a page"),
    ],
)
def test_words_that_do_not_go_together_are_refused(words, told):
    task = StylizedTrajectory(**{"scene": "s", "style": "p"} | words)
    with pytest.raises(InputError, match=told):
        task.require_sound()
    assert task.granted() is None
    assert not task.complete()


def test_settings_of_a_stage_and_a_wish_are_refused():
    """The settings that the front chooses would win over them, unseen."""
    words = ["StylizedTrajectory", "--scene", "s", "--style", "p", "--budget", "5min"]
    settings = ["--RadianceField-settings", '{"iterations": 9000}']
    with (
        CmdlineParser.global_instance([*words, *settings]) as command,
        pytest.raises(InputError, match="settings of RadianceField"),
    ):
        command.get_task_obj().require_sound()


def test_a_budget_needs_the_kind_of_scene_and_the_sources(tmp_path, monkeypatch):
    """Content is a source only where there is some."""
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    task = StylizedTrajectory(scene="s", style="p", budget="5min")
    sources = {"SceneCapture", "StyleImage", "PerceptualWeights", "TransferWeights"}
    assert set(task.requires()) == {"model"} | sources
    assert task.granted() is None, "while that is unknown"
    assert task.cells() == [task]
