"""The table of `benchmarks/README.md` is that of the figures and targets beside it."""

import json
import runpy
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def figures():
    return runpy.run_path(str(BENCHMARKS / "figures.py"))


def test_the_page_shows_the_figures_that_were_measured(figures):
    found = json.loads(figures["FIGURES"].read_text()) if figures["FIGURES"].exists() else {}
    _, _, rest = figures["PAGE"].read_text().partition(figures["BEGIN"])
    shown, _, _ = rest.partition(figures["END"])
    assert shown.splitlines() == list(figures["table"](found))


@pytest.mark.parametrize(("seconds", "is_missed"), [(9.9, False), (10.0, False), (10.1, True)])
def test_a_figure_beyond_its_target_is_marked(figures, seconds, is_missed):
    found = {"figures": {"time, s": seconds}, "commit": "0", "day": "1"}
    lines = [line for line in figures["table"]({"same again": found}) if "at most 10 " in line]
    assert len(lines) == 1
    assert ("missed" in lines[0]) == is_missed


def test_a_figure_may_be_a_ratio_of_two_values(figures):
    summary = {"resemblance": {"sharpness": 0.3, "sharpness_priors": 0.4}}
    asked = {"value": "resemblance.sharpness", "over": "resemblance.sharpness_priors"}
    assert figures["_value"](summary, asked) == pytest.approx(0.75)
