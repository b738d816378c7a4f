"""The page before the fit: what it advises, and that text stays text."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from message_words import mentions
from mini_scene import painted_plane, photographs_of

from styletrf.field.kernels import kernels_for
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.cost import FieldCost, field_cost, voxels_about
from styletrf.reports.expectation import Expectation, expectation_table
from styletrf.reports.scene_report import SceneReportContent, advice, write_scene_report
from styletrf.reports.survey_drawing import drawings
from styletrf.scene.survey import Survey, ViewSurvey
from styletrf.steps.scene_report import neighbors

GOOD = ViewSurvey("view 1", 1.0, 0.0, 100, blurred=False, off_exposure=False)
EXPECTED = Expectation(FieldCost(60.0, 2**30, 10**6), 300.0, 2**31, 2**20, 25.0)


def content(views=(GOOD,), seen_by=5, **more) -> SceneReportContent:
    cells = np.full((2, 2, 2), seen_by)
    return SceneReportContent(
        **{
            "scene": "place", "summary": "all of them", "drawings": "", "unregistered": [],
            "neighbors": {}, "model": {}, "expected": {"draft": EXPECTED}, "machine": "2 cores",
            "survey": Survey(views, cells, np.ones((2, 2, 2), bool)), **more,
        }
    )  # fmt: skip


def test_where_all_is_well_there_is_nothing_to_do(tmp_path):
    assert advice(content()) == []
    for report, items in ((content(), 0), (content(doubts=["no depth"]), 1)):
        write_scene_report(tmp_path / "r.html", report)
        assert (tmp_path / "r.html").read_text().count("<li>") == items


@pytest.mark.parametrize(
    ("spoiled", "named"),
    [
        (content([replace(GOOD, blurred=True)]), ["view 1"]),
        (content([replace(GOOD, off_exposure=True, exposure_ev=-1.0)]), ["view 1", "-1.0"]),
        (content(seen_by=2), ["100%"]),
        (content(doubts=["the photographs tell no depth"]), ["photographs tell no depth"]),
        (content(unregistered=["b1"], neighbors={"b1": ("a1", "c1")}), ["b1", "a1", "c1"]),
    ],
)
def test_what_is_amiss_is_named_with_what_to_do(spoiled, named):
    (line,) = advice(spoiled)
    assert mentions(line, *named)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("9", ("8", "10")), ("11", ("10", "10")), ("1", ("8", "8")), ("8b", ("8", "10"))],
)
def test_neighbors_of_a_photograph_are_those_beside_it_in_natural_order(name, expected):
    """Of `10` and `8`, the plain order put both before `9`."""
    assert neighbors([name], ["10", "8"]) == {name: expected}


def test_markup_in_names_of_a_scene_stays_text_in_its_report(tmp_path):
    name = "<script>alert(1)</script>"
    spoiled = content(
        [replace(GOOD, name=name, blurred=True)], scene=name, summary=name, model={name: name},
        evidence={name: {name: name}},
    )  # fmt: skip
    write_scene_report(tmp_path / "r.html", spoiled)
    assert name not in (tmp_path / "r.html").read_text()


def test_every_camera_is_drawn_and_the_flagged_otherwise():
    scene = painted_plane(5)
    points = np.random.default_rng(0).uniform(-1, 1, (30, 3))
    drawn = drawings(scene.cameras, points, np.zeros((30, 3), np.uint8), frozenset({"2"}))
    assert drawn.count("<polygon") == 2 * 5
    assert drawn.count("camera flagged") == 2
    assert drawn.count("<svg") == drawn.count("</svg>") == 2


def test_one_camera_and_one_point_can_be_drawn():
    scene = painted_plane(5)
    drawn = drawings(scene.cameras[:1], np.zeros((1, 3)), np.zeros((1, 3), np.uint8))
    assert "nan" not in drawn


def test_voxels_about_points_hold_them_and_their_neighbors():
    occupied = voxels_about(np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), (40, 40, 40))
    assert occupied.shape == (20, 20, 20)
    assert occupied[10, 10, 10] == 1
    assert occupied.sum() == 7**3
    assert voxels_about(np.zeros((0, 3)), (9, 9, 1)).all()


def test_a_quality_is_a_row_with_its_time_and_psnr_and_its_name_stays_text():
    table = expectation_table({"draft": EXPECTED, "<b>": EXPECTED}, "2 cores, <i>")
    assert table.count('<tr><th scope="row">') == 2
    assert "<b>" not in table
    assert "2 cores, &lt;i&gt;." in table
    assert {"5 min 00 s", "1 min 00 s", "2.00 GiB", "about 25.0 dB"} <= set(
        re.findall(r'"number">([^<]*)<', table)
    )


def test_a_quality_of_which_nothing_is_known_says_so():
    table = expectation_table({"draft": replace(EXPECTED, psnr_db=None)}, "2 cores")
    assert re.findall(r'"number">([^<]*)<', table)[-1] == "unknown"


def test_a_quality_whose_field_is_not_tried_is_a_row_and_named():
    untried = replace(EXPECTED, psnr_db=None, is_tried=False)
    table = expectation_table({"draft": EXPECTED, "<paper>": untried}, "2 cores")
    assert table.count('<tr><th scope="row">') == 2
    note = table.partition("<table>")[0]
    assert "&lt;paper&gt;" in note
    assert "draft" not in note


def test_a_cost_grows_with_the_iterations(tmp_path):
    photographs, model = photographs_of(painted_plane(), tmp_path)
    cpu = torch.device("cpu")

    def cost(iterations: int) -> FieldCost:
        config = FieldTrainingConfig(iterations=iterations, batch=64)
        return field_cost(model, photographs, config, kernels_for(cpu), cpu)

    assert cost(10_000).seconds > cost(100).seconds > 0
    assert cost(100).peak_memory_bytes > 2**26
