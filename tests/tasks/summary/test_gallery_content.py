"""The index of `out/`: what is shown there, and what became of the cells of a grid."""

import errno
import json
import os
from pathlib import Path

import pytest
from message_words import mentions

import tasks
from styletrf.reports.gallery.tile import OUTCOME_LABELS
from tasks.summary.gallery import refresh_gallery

WORDS = {"quality": "draft", "content": "embedded"}
NOT_BEGUN = f"<b>{OUTCOME_LABELS['not begun']}</b>"


def show(folder: Path, **more: object) -> None:
    """As if a stylized trajectory were shown there."""
    folder.mkdir(parents=True)
    (folder / "video.mp4").touch()
    errors = {"error": 0.002, "floor": 0.001, "style_distance": 0.25}
    consistency = {"delta_1": errors, "delta_5": {"error": None, "floor": None}}
    summary = {"quality": {"psnr": 23.456}, "consistency": consistency, **more}
    (folder / "summary.json").write_text(json.dumps(summary))


def test_requested_cells_have_a_tile_that_says_what_is_wrong(out: Path):
    grid = tasks.Grid(scenes=["mini", "nowhere"], styles=["p", "none"], **WORDS)
    text = refresh_gallery(grid).read_text()
    assert text.count("<li") == 4
    assert text.count(NOT_BEGUN) == 1
    assert text.count("StyleImage: style &#x27;none&#x27;: ") == 1  # SceneCapture failed first
    assert text.count("SceneCapture: scene &#x27;nowhere&#x27;: ") == 2


def test_what_is_shown_has_its_numbers(out: Path):
    show(out / "mini/p", cost={"seconds": 61.0}, parameters={"quality": "draft"})
    text = refresh_gallery(tasks.StylizedTrajectory(scene="mini", style="q", **WORDS)).read_text()
    for words in ("23.46 dB", "2.00 x floor", "0.2500", "1 min 01 s", "draft", "not measured"):
        assert f">{words}<" in text
    assert text.count(NOT_BEGUN) == 1


def test_a_summary_of_an_earlier_version_shows_its_quality(out: Path):
    show(out / "mini/p", words={"quality": "paper"})
    assert ">paper<" in refresh_gallery(None).read_text()


def test_results_of_separate_commands_are_not_crossed(out: Path):
    for name in ("horns/p", "fern/q", "fox/r"):
        show(out / name)
    assert refresh_gallery(None).read_text().count("<li") == 3


def test_what_a_grid_did_not_make_stays_until_it_is_made(out: Path):
    show(out / "mini/p")
    cells = [
        {"scene": "mini", "style": "p", "outcome": "failed", "reason": "Stage: of before"},
        {"scene": "mini", "style": "q", "outcome": "late", "reason": "Stage: it was six"},
        {"scene": "mini", "style": "r", "outcome": "made", "reason": ""},
    ]
    grid = {"ended": "2026-11-22T06:00:00+00:00", "cells": cells}
    (out / "grid.json").write_text(json.dumps(grid))
    (out / "mini/p/report.html").touch()
    text = refresh_gallery(None).read_text()
    assert text.count("<li") == 2
    assert OUTCOME_LABELS["late"] in text
    assert "of before" not in text, "it was made after the grid"
    (out / "grid.json").write_text(json.dumps({**grid, "ended": "2126-11-22T06:00:00+00:00"}))
    assert "of before" in refresh_gallery(None).read_text()
    (out / "grid.json").write_text("{")
    assert refresh_gallery(None).read_text().count("<li") == 1


def test_results_of_before_and_other_folders_do_no_harm(out: Path):
    show(out / "mini/p")
    (out / "mini/scene-report").mkdir()
    (out / "mini/scene-report/summary.json").write_text("{}")
    (out / "mini/gone").mkdir()
    (out / "mini/gone/video.mp4").symlink_to(out / "nowhere")
    assert refresh_gallery(None).read_text().count("<li") == 1


def test_an_earlier_result_stays_beside_what_failed(out: Path):
    show(out / "mini/none")
    text = refresh_gallery(
        tasks.StylizedTrajectory(scene="mini", style="none", **WORDS)
    ).read_text()
    assert f"<b>{OUTCOME_LABELS['failed']}; " in text
    assert 'data-video="mini/none/video.mp4"' in text


def test_a_page_that_cannot_be_written_is_no_failure(out: Path, caplog: pytest.LogCaptureFixture):
    (out / "index.html/x").mkdir(parents=True)
    assert refresh_gallery(None) is None
    assert mentions(caplog.text, out / "index.html")
    assert list(out.glob(".*")) == []


@pytest.mark.parametrize("summary", ["{}", "[]", '{"quality": "good"}', "{", None])
def test_a_folder_with_the_summary_of_another_program_is_left_out_alone(
    out: Path, caplog: pytest.LogCaptureFixture, summary: str | None
):
    """It hid all results."""
    show(out / "mini/p")
    foreign = out / "mini/foreign"
    show(foreign)
    (foreign / "summary.json").unlink()
    if summary is None:
        (foreign / "summary.json").mkdir()
    else:
        (foreign / "summary.json").write_text(summary)
    assert refresh_gallery(None).read_text().count("<li") == 1
    (message,) = caplog.messages
    assert mentions(message, foreign)


def test_a_scene_that_cannot_be_read_is_left_out_alone(
    out: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    show(out / "yard/p")
    show(out / "mini/p")
    look_at, locked = Path.stat, out / "mini"

    def refused(path: Path, **more: bool) -> os.stat_result:
        if locked in path.parents:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return look_at(path, **more)

    monkeypatch.setattr(Path, "stat", refused)
    requested = tasks.StylizedTrajectory(scene="mini", style="q", **WORDS)
    text = refresh_gallery(requested).read_text()
    assert 'data-video="yard/p/video.mp4"' in text
    assert "mini/p" not in text
    assert text.count(NOT_BEGUN) == 1
    (message,) = caplog.messages
    assert mentions(message, locked)
