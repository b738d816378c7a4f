"""Fronts of times and losses of any size."""

from dataclasses import replace

import pytest

from styletrf.evaluation.pareto_front import pareto_front
from styletrf.evaluation.trade_off import Measurement, combinations

TRADE_OFF = pytest.mark.extremes("Trade-off")


def measured(unit_s: float) -> list[Measurement]:
    """Returns three variants of each side, whose times are multiples of a unit."""
    found = []
    for part, stage in (("scene", "RadianceField"), ("style", "StyleNetwork")):
        for name, seconds, quality_db in (("", 4, 25.0), ("fast", 1, 22.0), ("slow", 9, 26.0)):
            times = {stage: seconds * unit_s, "TrajectoryFrames": unit_s * (part == "scene")}
            found.append(Measurement(part, name, {}, quality_db, times, 0.0, 1, {}))  # type: ignore[arg-type]
    return found


@TRADE_OFF
@pytest.mark.parametrize("unit_s", [1e-12, 1e-3, 1e6, 1e12])
def test_a_front_does_not_depend_on_the_unit_of_time(unit_s, stability):
    fronts = [pareto_front(combinations(measured(unit)), measured(unit)) for unit in (unit_s, 1.0)]
    names = [[(p.combination.scene, p.combination.style) for p in front] for front in fronts]
    assert names[0] == names[1]
    found, exact = ([p.combination.seconds for p in front] for front in fronts)
    stability(f"seconds, in units of {unit_s:g} s", [s / unit_s for s in found], exact)


@TRADE_OFF
@pytest.mark.parametrize("extreme_db", [-1e6, 1e6])
def test_a_variant_of_any_loss_is_on_the_front_only_if_none_beats_it(extreme_db, stability):
    measurements = measured(1.0)
    measurements[2] = replace(measurements[2], quality_db=extreme_db)
    points = combinations(measurements)
    front = [point.combination for point in pareto_front(points, measurements)]
    for one in points:
        beaten = any(
            other.seconds <= one.seconds and other.shortfall_db < one.shortfall_db
            for other in points
        )
        assert not (beaten and one in front)
    stability(f"least shortfall at {extreme_db:g} dB", min(p.shortfall_db for p in front), 0.0)


@TRADE_OFF
def test_stages_that_took_no_time_divide_by_nothing():
    idle = [replace(m, seconds=dict.fromkeys(m.seconds, 0.0)) for m in measured(1.0)]
    assert {point.seconds for point in combinations(idle)} == {0}
