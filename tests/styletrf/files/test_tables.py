"""Rows, summaries, and configurations from plain values."""

import itertools
import json
import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import pytest
from expected_errors import rejects

from styletrf.configuration import configured, require_at_least, require_within
from styletrf.errors import InputError
from styletrf.files.tables import read_rows, read_summary, write_curve, write_rows, write_summary
from styletrf.stylization.adaptation import AdaptationCurvePoint


@dataclass(frozen=True)
class Inner:
    width: int = 3
    ranks: tuple[int, ...] = (1, 2)


@dataclass(frozen=True)
class Range:
    least: int = 0
    most: int = 2

    def __post_init__(self) -> None:
        require_at_least(self.least, self, "most")


@dataclass(frozen=True)
class Outer:
    inner: Inner = field(default_factory=Inner)
    rate: float = 0.1
    count: int | None = None
    share: float | None = None
    size: tuple[float, float] = (1.0, 2.0)
    word: Literal["a", "b"] = "a"
    range: Range = field(default_factory=Range)

    def __post_init__(self) -> None:
        require_within("(0, 1]", self, "rate")
        if self.range.most > self.inner.width:
            raise ValueError(f"range.most is {self.range.most}, above {self.inner.width}")


def test_rows_that_are_written_come_back_as_they_were(tmp_path: Path):
    rows = [Inner(1, (2, 3)), Inner(4, (5,))]
    write_rows(tmp_path / "rows.parquet", rows)
    rows = read_rows(tmp_path / "rows.parquet")
    assert rows == [{"width": 1, "ranks": [2, 3]}, {"width": 4, "ranks": [5]}]


def test_a_curve_of_another_day_has_the_same_bytes(tmp_path: Path):
    """What training took is the record's: else nothing made of two equal fits would be shared."""
    point = AdaptationCurvePoint(10, 1.5, 30.0)
    write_curve(tmp_path / "a.parquet", [point])
    write_curve(tmp_path / "b.parquet", [replace(point, seconds=99.0)])
    assert read_rows(tmp_path / "a.parquet") == [{"iteration": 10, "psnr": 30.0}]
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_a_summary_is_strict_json_with_sorted_keys(tmp_path: Path):
    write_summary(tmp_path / "s.json", {"b": math.inf, "a": {"x": math.nan, "y": 1.5}})
    text = (tmp_path / "s.json").read_text()
    assert json.loads(text, parse_constant=pytest.fail) == {"a": {"x": None, "y": 1.5}, "b": None}
    assert text.index('"a"') < text.index('"b"')
    assert read_summary(tmp_path / "s.json")["a"]["y"] == 1.5


def test_dots_reach_into_nested_configurations():
    config = configured(Outer, {"inner.width": 9, "inner.ranks": [7], "rate": 1, "count": 5})
    assert config == Outer(Inner(9, (7,)), 1.0, 5)


def test_whole_numbers_become_floats_and_none_stays_none():
    config = configured(Outer, {"share": 1, "size": [3, 4], "count": None})
    assert config == Outer(share=1.0, size=(3.0, 4.0))
    assert [type(value) for value in (config.share, *config.size)] == [float] * 3


@pytest.mark.parametrize(
    ("name", "value", "named", "remedy"),
    [
        ("widht", 3, ["Outer"], "count, inner, range, rate, share, size, word"),
        ("inner.hight", 3, ["Inner"], "ranks, width"),
        ("rate.x", 3, ["rate"], "'rate'"),
        ("inner.width", "wide", ["'wide'", "whole"], ""),
        ("inner.width", True, ["True", "whole"], ""),
        ("inner.width", None, ["None", "whole"], ""),
        ("inner.ranks", 3, ["3", "int"], ""),
        ("inner.ranks", [1, "2"], ["'2'", "int"], ""),
        ("inner.ranks", [1, [2]], ["[2]", "int"], ""),
        ("inner", 3, ["3", "Inner"], ""),
        ("rate", 0.0, ["rate", "0.0", "(0, 1]"], ""),
        ("rate", 1.5, ["rate", "1.5", "(0, 1]"], ""),
        ("range.most", -1, ["most", "-1", "0"], ""),
        ("rate", math.nan, ["nan", "finite"], ""),
        ("rate", math.inf, ["inf", "finite"], ""),
        pytest.param("rate", 10**400, ["finite"], "", id="rate-huge"),
        ("count", "many", ["'many'", "int"], ""),
        ("count", 2.5, ["2.5", "int"], ""),
        ("share", "high", ["'high'", "float"], ""),
        ("share", math.nan, ["nan", "float"], ""),
        ("size", [1.0], ["[1.0]", "float"], ""),
        ("size", [1.0, True], ["True", "float"], ""),
        ("word", "c", ["'c'"], "a, b"),
        ("word", 1, ["1"], "a, b"),
    ],
)
def test_a_setting_that_does_not_fit_is_an_error_that_names_what_would(name, value, named, remedy):
    with rejects(f"setting {name!r}", *named) as refusal:
        configured(Outer, {name: value})
    assert remedy in refusal.value.remedy


VALID = {"range.least": 5, "range.most": 7, "inner.width": 9, "rate": 0.5}
"""Values of which some do not fit the defaults of others."""


@pytest.mark.parametrize("names", list(itertools.permutations(VALID)), ids=", ".join)
def test_the_order_of_settings_does_not_matter(names):
    config = configured(Outer, {name: VALID[name] for name in names})
    assert config == Outer(Inner(9), rate=0.5, range=Range(5, 7))


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"rate": 2.0}, ["rate"]),
        ({"range.least": 8}, ["range.least"]),
        ({"range.least": 2, "range.most": 1}, ["range.least", "range.most"]),
    ],
)
def test_of_many_settings_the_error_names_those_without_which_the_others_fit(changed, named):
    with pytest.raises(InputError) as caught:
        configured(Outer, VALID | changed)
    assert set(re.findall(r"'([\w.]+)'", caught.value.subject)) == set(named)


def test_two_settings_that_are_refused_are_an_error_about_the_configuration():
    with rejects("settings of Outer", "most"):
        configured(Outer, {"rate": 2.0, "range.most": -1})
