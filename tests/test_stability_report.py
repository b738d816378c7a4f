"""The committed stability report is of the tests that there are, and errors are what it says."""

import math
from pathlib import Path

import numpy as np
import pytest
from stability import COMMITTED, Row, deviation, in_markdown, law_in_words

HERE = Path(__file__).parent


def test_the_committed_report_has_every_law_of_extremes(request: pytest.FixtureRequest):
    """Else run `make stability`; of the tests that this run has collected."""
    report = COMMITTED.read_text()
    laws = {law_in_words(i.name) for i in request.session.items if i.get_closest_marker("extremes")}
    listed = {line.split("|")[1].strip() for line in report.splitlines() if line.startswith("| ")}
    assert laws - listed == set()
    assert "FAILED" not in report
    extreme = {p for p in HERE.rglob("test_*.py") if "pytest.mark.extremes(" in p.read_text()}
    if extreme <= {item.path for item in request.session.items}:
        assert listed - laws - {"", "what holds"} == set(), "no such tests any more"


@pytest.mark.parametrize(
    ("found", "exact", "expected"),
    [
        ([1.0, 2.02], [1.0, 2.0], 0.01),
        ([0.25], [0.0], 0.25),
        ([math.inf, 1.0], [math.inf, 1.0], 0.0),
        ([math.nan, 1.0], [math.nan, 1.0], 0.0),
        ([math.nan, 1.0], [3.0, 1.0], math.inf),
        ([math.inf], [-math.inf], math.inf),
        ([], [], 0.0),
    ],
)  # fmt: skip
def test_the_error_is_relative_to_the_largest_value(found, exact, expected):
    assert deviation(np.array(found), np.array(exact)) == pytest.approx(expected)


def test_of_rows_that_differ_in_the_error_the_worst_is_shown_rounded_up():
    rows = [
        Row("m", "f", 1, "a law", "a case", "float32", "finite", e, 1e-4) for e in (2e-7, 3e-6, 0.0)
    ]
    assert in_markdown(rows).endswith("| a law | a case | float32 | finite | 1e-5 | 1e-4 |\n")
    assert in_markdown(rows).count("a case") == 1
