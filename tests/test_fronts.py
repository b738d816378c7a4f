"""One front of the fronts around two qualities (`benchmarks/fronts.py`), and the shipped one."""

import json
import runpy
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from styletrf.evaluation.trade_off import Combination
from tasks.planning.stage_costs import reference_costs
from tasks.presets.presets import PRESETS
from tasks.presets.quality_choice import SHIPPED, by_quality

ROOT = Path(__file__).parents[1]
POINT = Combination("", "", {}, 0.0, 26.0, -1.0, 30.0, 1.0, 0.0, 1, 1,
                    stage_seconds={"RadianceField": 20.0, "StyleNetwork": 10.0})  # fmt: skip
FAST = replace(POINT, scene="quick", psnr_db=24.0, shortfall_db=2.0, seconds=20.0,
               stage_seconds={"RadianceField": 10.0, "StyleNetwork": 10.0})  # fmt: skip


@pytest.fixture(scope="module")
def joined():
    return runpy.run_path(str(ROOT / "benchmarks" / "fronts.py"))["joined"]


def front(quality, *points, slower=1.0, scene="s"):
    """What `TradeOff` writes on a machine that is so many times slower than the reference's."""
    calibration = asdict(reference_costs().calibration)
    calibration["seconds"] = {k: slower * s for k, s in calibration["seconds"].items()}
    return {
        "scene": scene, "style": "p", "space": "box", "photographs": {}, "quality": quality,
        "changes": "1 of 9 changes", "calibration": calibration,
        "points": [{"combination": asdict(point)} for point in points],
    }  # fmt: skip


def points_of(found):
    return [Combination(**each["combination"]) for each in found["points"]]


def test_points_of_two_fronts_fall_short_of_the_best_of_both(joined):
    better = replace(POINT, psnr_db=27.5, style_db=-0.5, seconds=60.0,
                     stage_seconds={"RadianceField": 60.0})  # fmt: skip
    found = points_of(joined([front("draft", FAST, POINT), front("standard", better)]))
    assert [point.quality for point in found] == ["draft", "draft", "standard"]
    assert [point.shortfall_db for point in found] == [3.5, 1.5, 0.0]


def test_points_that_one_of_the_other_quality_beats_are_left_out(joined):
    poor = replace(FAST, psnr_db=25.0, seconds=40.0, stage_seconds={"RadianceField": 40.0})
    found = points_of(joined([front("draft", FAST, POINT), front("standard", poor)]))
    assert [point.quality for point in found] == ["draft", "draft"]


def test_seconds_become_those_of_the_first_machine(joined):
    """The second front was measured on a machine twice as slow, with twice the seconds."""
    slow = replace(POINT, psnr_db=28.0, seconds=60.0,
                   stage_seconds={"RadianceField": 40.0, "StyleNetwork": 20.0})  # fmt: skip
    found = points_of(joined([front("draft", FAST), front("standard", slow, slower=2.0)]))
    assert found[-1].seconds == pytest.approx(30.0)
    assert found[-1].stage_seconds == pytest.approx(POINT.stage_seconds)


def test_fronts_of_two_scenes_are_not_joined(joined):
    with pytest.raises(ValueError, match="scene"):
        joined([front("draft", POINT), front("standard", POINT, scene="t")])


def test_a_front_joined_with_itself_stays_as_it_is(joined):
    once = front("draft", FAST, POINT)
    expected = [replace(point, quality="draft") for point in (FAST, POINT)]
    found = points_of(joined([once, once]))
    assert all(point in expected for point in found)
    assert all(point in found for point in expected)


def test_a_combination_that_was_beaten_in_its_own_front_may_be_in_the_joined_one(joined):
    """Twice the iterations with the least style: beaten by less of both, until the best rose."""
    frames = {"TrajectoryFrames": 10.0, "PriorRenders": 4.0}
    one = replace(FAST, style="slow", style_db=0.5, stage_seconds={**FAST.stage_seconds, **frames})
    other = replace(POINT, style="", stage_seconds={**POINT.stage_seconds, **frames,
                    "TrajectoryFrames": 20.0})  # fmt: skip
    (found,) = [
        point for point in points_of(joined([front("draft", one, other)] * 2))
        if (point.scene, point.style) == ("", "slow")
    ][:1]  # fmt: skip
    assert (found.psnr_db, found.style_db) == (26.0, 0.5)
    assert found.stage_seconds == {
        "RadianceField": 20.0, "TrajectoryFrames": 20.0, "StyleNetwork": 10.0, "PriorRenders": 8.0,
    }  # fmt: skip
    assert found.seconds == sum(found.stage_seconds.values())


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.json")), ids=lambda path: path.stem)
def test_each_point_of_a_shipped_front_is_better_than_all_faster_ones(path):
    """Each is looked at before a budget is refused, which took 7 s with those of no use."""
    shipped = json.loads(path.read_text())
    points = sorted(points_of(shipped), key=lambda point: point.seconds)
    assert {p.quality or shipped["quality"] for p in points} <= set(PRESETS)
    for k, point in enumerate(points):
        faster = [p for p in points[:k] if point.stylizer or not p.stylizer]
        assert all(by_quality(point) < by_quality(p) for p in faster), (point.scene, point.style)
