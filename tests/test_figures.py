"""The table of `benchmarks/README.md` is that of the figures and targets beside it."""

import json
import re
import runpy
from itertools import chain
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
REQUIRED, OPTIONAL = (
    {"what", "sections"},
    {"target", "figure", "missed", "commit", "day", "machine"},
)


@pytest.fixture(scope="module")
def figures():
    return runpy.run_path(str(BENCHMARKS / "figures.py"))


def test_the_page_shows_the_figures_that_were_measured(figures):
    found = json.loads(figures["FIGURES"].read_text()) if figures["FIGURES"].exists() else {}
    _, _, rest = figures["PAGE"].read_text().partition(figures["BEGIN"])
    shown, _, _ = rest.partition(figures["END"])
    assert shown.splitlines() == list(figures["table"](found))


@pytest.fixture(scope="module")
def entries(figures):
    return list(chain.from_iterable(figures["entered"]().values()))


def test_the_page_begins_with_the_table(figures):
    """A title and a sentence or two may stand before it."""
    before, found, _ = figures["PAGE"].read_text().partition(figures["BEGIN"])
    title, *prose = filter(None, before.splitlines())
    assert found
    assert title.startswith("# ")
    assert len(prose) <= 2
    assert not any(line.startswith(("#", "|")) for line in prose)


def test_every_row_of_the_table_has_a_cell_for_each_column(figures):
    rows = [line for line in figures["table"]({}) if line.startswith("|")]
    assert {row.count("|") for row in rows} == {rows[0].count("|")}


def test_every_link_to_a_section_of_the_history_leads_to_a_heading(figures):
    headings = re.findall(r"^#+ (.+)$", (BENCHMARKS / "history.md").read_text(), re.M)
    anchors = {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}
    assert set(re.findall(r"history\.md#([^)]+)\)", figures["PAGE"].read_text())) - anchors == set()


def test_every_entered_figure_has_a_section_and_known_fields(entries):
    odd = [e for e in entries if not REQUIRED <= e.keys() <= REQUIRED | OPTIONAL]
    assert [entry["what"] for entry in odd] == []
    assert [entry["what"] for entry in entries if not entry["sections"]] == []


def test_a_miss_is_marked_in_the_figure_and_by_its_field(entries):
    wrong = [e for e in entries if e.get("missed", False) != ("**miss" in e.get("figure", ""))]
    assert [entry["what"] for entry in wrong] == []


def test_an_entered_figure_has_a_day_and_what_was_not_measured_has_a_target(entries):
    assert [e["what"] for e in entries if ("figure" in e) != ("day" in e)] == []
    assert [e["what"] for e in entries if "figure" not in e and "target" not in e] == []


def test_a_target_without_a_figure_is_shown_as_not_measured(figures):
    assert "not measured" in figures["_entered_row"]({"what": "x", "sections": {}}, "usual")


@pytest.mark.parametrize(("machine", "is_named"), [("usual", False), ("other", True)])
def test_a_row_names_its_machine_unless_it_is_the_usual_one(figures, machine, is_named):
    made = figures["_provenance"]({"commit": "0", "day": "1", "machine": machine}, "usual")
    assert (machine in made) == is_named


def test_the_usual_machine_stands_before_the_table(figures):
    first = next(figures["table"]({}))
    assert figures["_promises"]()["machine"] in first


def test_an_earlier_target_is_easier_to_meet(figures):
    every = [figure for run in figures["runs"]() for figure in run["figures"]]
    before = [figure for figure in every if "earlier" in figure]
    assert before
    for figure in before:
        assert figures["_shown"](figure, figure["earlier"]).startswith("**missed")


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
