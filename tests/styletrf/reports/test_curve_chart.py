import math
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from styletrf.reports.curve_chart import Curve, curve_svg, short, ticks


def chart(values, seconds=None, **names):
    seconds = list(range(len(values))) if seconds is None else seconds
    return curve_svg(
        Curve(
            names.get("title", "t"), names.get("quantity", "q"), seconds, list(map(float, values))
        )
    )


def line(svg):
    points = ET.fromstring(svg).find("polyline").attrib["points"]
    return np.array([[float(x) for x in point.split(",")] for point in points.split()])


@pytest.mark.parametrize(
    ("low", "high"), [(0, 1), (11.3, 24.8), (-3, 2e-9), (1e-6, 2e-6), (0, 3e7), (5, 5), (0, 0)]
)
def test_ticks_are_round_few_and_enclose(low, high):
    values = ticks(low, high)
    step = values[1] - values[0]
    assert values[0] <= low <= high <= values[-1]
    assert 2 <= len(values) <= 7
    assert np.diff(values) == pytest.approx(step)
    mantissa = step / 10 ** math.floor(math.log10(step) + 1e-9)
    assert any(mantissa == pytest.approx(factor) for factor in (1, 2, 5))


def test_the_line_rises_where_the_values_rise_and_stays_inside():
    points = line(chart([1.0, 2.0, 3.0, 5.0]))
    assert (np.diff(points[:, 0]) > 0).all()
    assert (np.diff(points[:, 1]) < 0).all()  # y points down
    assert points.min() >= 0
    assert points[:, 0].max() <= 320
    assert points[:, 1].max() <= 190


def test_equal_steps_are_drawn_equal():
    points = line(chart(np.arange(9.0)))
    assert np.diff(points[:, 0]) == pytest.approx(np.diff(points[:, 0])[0], abs=0.2)
    assert np.diff(points[:, 1]) == pytest.approx(np.diff(points[:, 1])[0], abs=0.2)


def test_long_curves_are_thinned_and_keep_their_level():
    svg = chart(np.random.default_rng(0).normal(10, 1, 10_000))
    assert len(line(svg)) <= 240
    assert len(svg) < 10_000


def test_what_is_not_finite_is_left_out():
    with_gaps = chart([1.0, np.nan, 3.0, np.inf, 5.0])
    assert len(line(with_gaps)) == 3
    assert chart([np.nan, np.inf]) == ""
    assert chart([]) == ""


@pytest.mark.parametrize("values", [[4.0], [0.0, 0.0], [7.0, 7.0, 7.0]])
def test_constants_and_single_points_are_drawn(values):
    assert np.isfinite(line(chart(values))).all()


def test_markup_in_the_names_of_a_chart_stays_text():
    svg = chart([1.0, 2.0], title='<b>"', quantity="a & b")
    assert "a &amp; b of &lt;b&gt;&quot; against iteration" in svg
    ET.fromstring(svg)


def test_the_last_value_is_written():
    assert re.search(r'class="value"[^>]*>23.46<', chart([1.0, 23.4567]))


@pytest.mark.parametrize(
    ("value", "text"), [(23.4567, "23.46"), (75493.0, "75.5k"), (0.0041234, "0.00412"), (0.0, "0")]
)
def test_numbers_of_a_chart_have_few_digits(value, text):
    assert short(value) == text
