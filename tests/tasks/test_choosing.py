"""Wishes for time and accuracy, and the fronts that grant them."""

import json
from dataclasses import asdict

import pytest

from styletrf.errors import InputError
from styletrf.trade_off import Combination
from tasks import StylizedTrajectory
from tasks.choosing import SHIPPED, choose, wish_of

FAST = Combination(
    "quick", "", {"RadianceField": {"iterations": 9}}, 0.8, 24.0, -5.0, 100.0, 1.0, 1, 1
)
GOOD = Combination("", "", {}, 0.0, 24.8, -5.0, 280.0, 1.0, 1, 1)


def front(path, points=(FAST, GOOD)):
    told = {"scene": "s", "quality": "draft", "measured": "2026-01-01", "machine": "2 cores"}
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


@pytest.mark.parametrize("space", ["ndc", "box", "unbounded"])
def test_a_front_is_shipped_for_every_kind_of_scene(tmp_path, space):
    choice = choose(wish_of("within 1 dB", ""), tmp_path / "none", space)
    assert f"shipped front for {space} space" in choice.told
    assert json.loads((SHIPPED / f"{space}.json").read_text())["space"] == space


def test_other_words_are_no_quality():
    with pytest.raises(ValueError, match="choice"):
        StylizedTrajectory(scene="s", style="p", quality="within reason")
