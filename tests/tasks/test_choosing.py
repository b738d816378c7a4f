"""Wishes for time and accuracy, and the fronts that grant them."""

import json
from dataclasses import asdict

import pytest

from styletrf.errors import InputError
from styletrf.trade_off import Combination
from tasks import StylizedTrajectory
from tasks.choosing import SHIPPED, choose, wish_of

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
    assert "this scene" in choice.told


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


@pytest.mark.parametrize("space", sorted(path.stem for path in SHIPPED.glob("*.json")))
def test_the_shipped_fronts_grant_wishes(tmp_path, space):
    choice = choose(wish_of("within 1 dB", ""), tmp_path / "none", space)
    assert f"shipped front for {space} space" in choice.told
    assert json.loads((SHIPPED / f"{space}.json").read_text())["space"] == space


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


def test_a_wish_needs_but_the_kind_of_scene():
    task = StylizedTrajectory(scene="s", style="p", budget="5min")
    assert set(task.requires()) == {"model"}
    assert task.granted() is None, "while that is unknown"
    assert task.cells() == [task]
