"""The figures of a result's measures: each beside its floor, and what was not measured as such."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from message_words import mentions

from tasks.summary.metric_labels import (
    CONSISTENCY,
    QUALITY,
    RESEMBLANCE,
    metric_tables,
    significant,
)

ERRORS = {m.key: 0.002 for m in CONSISTENCY} | {m.other: 0.001 for m in CONSISTENCY if m.other}
SUMMARY = {
    "quality": {m.key: 20.0 for m in QUALITY},
    "resemblance": {m.key: 0.5 for m in RESEMBLANCE}
    | {m.other: 0.8 for m in RESEMBLANCE if m.other},
    "consistency": {"delta_5": {**ERRORS, "flow": "dis"}, "delta_1": {**ERRORS, "flow": "dis"}},
}


def figures(summary) -> dict[str, list[tuple[str, str]]]:
    return {
        metric.name: [(figure.value, figure.beside) for figure in metric.figures]
        for table in metric_tables(summary)
        for metric in table.metrics
    }


def test_every_measure_is_shown_once_beside_its_floor_short_term_first():
    assert len(figures(SUMMARY)) == len(QUALITY) + len(RESEMBLANCE) + len(CONSISTENCY)
    between = metric_tables(SUMMARY)[2]
    assert list(between.columns) == ["short term", "long term"]
    for measure, metric in zip(CONSISTENCY, between.metrics, strict=True):
        assert all(bool(figure.beside) == bool(measure.other) for figure in metric.figures)
    assert figures(SUMMARY)["error along the flow"] == [
        ("0.00200", "floor 0.00100, 2.00\N{NO-BREAK SPACE}times")
    ] * 2  # fmt: skip


def test_a_distance_to_the_painting_stands_beside_the_unstylized_frames():
    beside = "unstylized 0.80, 0.625\N{NO-BREAK SPACE}times"
    assert figures(SUMMARY)["texture"] == [("0.50", beside)]


def test_what_has_no_value_is_not_measured():
    deltas = {"delta_1": {"error": None, "floor": 0.1}, "delta_5": {"error": 0.1, "floor": None}}
    lost = figures({"quality": {"psnr": None}, "consistency": deltas})
    assert lost["PSNR"] == [("not measured", "")]
    assert lost["error along the flow"] == [
        ("not measured", ""),
        ("0.100", "floor not measured"),
    ]


def test_what_was_not_asked_is_left_out_and_a_floor_of_nothing_divides_nothing():
    of_one = figures({"quality": {}, "consistency": {"delta_2": {"error": 0.5, "floor": 0.0}}})
    assert of_one == {"error along the flow": [("0.500", "floor 0")]}


@pytest.mark.parametrize(
    ("value", "written"),
    [(0.00012345, "0.000123"), (0.09999, "0.100"), (1.0, "1.00"), (26.318, "26.3"),
     (1234.0, "1230"), (0.0, "0"), (-0.0456, "-0.0456"), (math.inf, "inf")],
)  # fmt: skip
def test_numbers_have_three_significant_digits(value, written):
    assert significant(value) == written


@given(st.floats(1e-9, 1e9))
def test_what_is_written_is_within_half_a_unit_of_the_third_digit(value):
    assert float(significant(value)) == pytest.approx(value, rel=0.005)
    assert "e" not in significant(value)


def beside_the_error(sharpness: float, floor: float = 0.002) -> str:
    """What stands beside an error of 0.001 along the flow, and not beside the style's distance."""
    errors = {"error": 0.001, "floor": floor, "style_distance": 0.1} | {
        "style_distance_unstylized": 0.2
    }
    summary = {"quality": {}, "consistency": {"delta_1": errors}}
    summary["resemblance"] = {"sharpness_to_unstylized": sharpness}
    found = figures(summary)
    ((_, distance),) = found["style distance"]
    assert not mentions(distance, significant(sharpness)), "nearer to the painting is no want"
    ((_, beside),) = found["error along the flow"]
    return beside


def test_a_ratio_below_one_is_explained_beside_the_sharpness():
    blurred, sharp = beside_the_error(0.6), beside_the_error(1.2)
    assert mentions(blurred, significant(0.6))
    assert mentions(sharp, significant(1.2))
    assert blurred.replace(significant(0.6), "") != sharp.replace(significant(1.2), "")
    assert not mentions(beside_the_error(0.6, floor=0.0005), significant(0.6))
