"""The gallery of results: every scene in every style, sortable, also in a real browser."""

from pathlib import Path

import numpy as np
import pytest
from headless import answer_of, needs_chromium
from test_report import HOSTILE, Page, moving

from styletrf.files.images import write_rgb
from styletrf.files.video import write_video
from styletrf.reports.gallery import Cell, Score, write_gallery


def scores(psnr, error):
    text = "not measured" if error is None else f"{error} x floor"
    return [Score("PSNR", psnr, f"{psnr} dB", "highest"), Score("short-term", error, text)]


CELLS = [
    Cell("horns", "udnie", is_made=True, quality="draft", scores=scores(26.4, 0.7)),
    Cell("horns", "brush", is_made=True, quality="draft", scores=scores(26.4, None)),
    Cell("fern", "udnie", is_made=True, scores=scores(25.0, 0.9), failure="CameraPoses: no luck"),
    Cell("fern", "mosaic", failure="StyleImage: there is no such style"),
    Cell("fern", "brush", failure="StyleNetwork", is_under_way=True),
]


def written(tmp_path: Path, cells) -> Page:
    write_gallery(tmp_path / "index.html", cells)
    return Page((tmp_path / "index.html").read_text())


def test_every_scene_has_a_place_in_every_style(tmp_path: Path):
    page = written(tmp_path, CELLS)
    assert page.tags.count("li") == 2 * 3
    assert page.tags.count("video") == 3
    for words in ("3 of 6 made, 2 failed.", "Not made yet", "Being made", "0.7 x floor", "no luck"):
        assert words in page.text
    assert "StyleImage: there is no such style" in page.text
    assert "Failed anew; this is an earlier one" in page.text


def test_it_names_only_files_below_itself(tmp_path: Path):
    odd = Cell("javascript:x", "../a b", is_made=True)
    for address in written(tmp_path, [*CELLS, odd]).addresses:
        scene, style, file = address.split("/")
        assert file in ("video.mp4", "poster.png", "style.png", "report.html")
        assert ":" not in address
        assert {scene, style}.isdisjoint({"", "..", "."})


def test_a_viewer_is_linked_where_there_is_one(tmp_path: Path):
    with_viewer, without = (Cell("a b", "x", is_made=True, has_viewer=has) for has in (True, False))
    assert "a%20b/viewer.html" in written(tmp_path, [with_viewer]).addresses
    assert not any("viewer" in address for address in written(tmp_path, [without]).addresses)


def test_text_stays_text(tmp_path: Path):
    harmless = written(tmp_path, CELLS[2:3])
    text = [Score(HOSTILE, 1.0, HOSTILE), Score("PSNR", 1.0, "x")]
    hostile = Cell(HOSTILE, HOSTILE, is_made=True, quality=HOSTILE, scores=text, failure=HOSTILE)
    page = written(tmp_path, [hostile])
    assert sorted(page.tags) == sorted(harmless.tags)
    assert page.text.count(HOSTILE) >= 4


def test_the_same_cells_give_the_same_bytes_in_any_order(tmp_path: Path):
    write_gallery(tmp_path / "a.html", CELLS)
    write_gallery(tmp_path / "b.html", CELLS[::-1])
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_nothing_at_all_is_a_page_too(tmp_path: Path):
    assert "Nothing yet." in written(tmp_path, []).text


PROBE = """
  const names = () => [...document.querySelectorAll(".tile h2")].map((h) => h.innerText.trim());
  const button = (key) => document.querySelector(`.sort button[data-key="${key}"]`);
  const sorted = (key) => { button(key).click(); return names().map((n) => n.split("  ")[0]); };
  const orders = {};
  for (const key of ["scene", "style", "PSNR", "short-term"]) {
    if (key !== "scene") orders[key] = sorted(key);
    orders[key + " reversed"] = sorted(key);
  }
  const pressed = document.querySelectorAll('.sort [aria-pressed="true"]').length;
  const videos = [...document.querySelectorAll("video")];
  const still = videos.every((v) => v.paused && !v.controls);
  const tile = videos[0].closest(".tile");
  tile.querySelector("a").focus();
  await until(() => videos[0].currentTime > 0.1);
  const alone = videos.slice(1).every((v) => v.paused);
  tile.querySelector("a").blur();
  document.querySelector(".play-all").click();
  for (const video of videos) {
    video.scrollIntoView({ block: "center" });
    await until(() => !video.paused && video.currentTime > 0.1);
  }
  document.querySelector(".play-all").click();
  await until(() => videos.every((v) => v.paused));
  return { orders, pressed, still, alone, overflow: overflow(), links: document.links.length };
"""
ORDERS = {
    "scene reversed": ["hb", "hm", "hu", "fb", "fm", "fu"],
    "style": ["fb", "hb", "fm", "hm", "fu", "hu"],
    "style reversed": ["fu", "hu", "fm", "hm", "fb", "hb"],
    "PSNR": ["hb", "hu", "fu", "fb", "fm", "hm"],
    "PSNR reversed": ["fu", "hb", "hu", "fb", "fm", "hm"],
    "short-term": ["hu", "fu", "fb", "fm", "hb", "hm"],
    "short-term reversed": ["fu", "hu", "fb", "fm", "hb", "hm"],
}


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_a_browser_sorts_it_and_plays_its_videos(tmp_path: Path, width: int):
    for cell in CELLS[:3]:
        folder = tmp_path / cell.scene / cell.style
        folder.mkdir(parents=True)
        write_video(folder / "video.mp4", moving(0), 24)
        for name in ("poster", "style"):
            write_rgb(folder / f"{name}.png", np.full((48, 64, 3), 0.5, dtype=np.float32))
    write_gallery(tmp_path / "index.html", CELLS)
    answer = answer_of(tmp_path / "index.html", PROBE, width)
    assert answer["errors"] == []
    orders = {key: [_initials(name) for name in names] for key, names in answer["orders"].items()}
    assert orders == ORDERS
    assert (answer["pressed"], answer["links"], answer["overflow"]) == (1, 3, 0)
    has_mouse = width > 700  # where there is none, what is on the screen plays by itself
    assert answer["still"] == has_mouse
    assert answer["alone"] or not has_mouse


def _initials(name: str) -> str:
    scene, style = name.split(" · ")
    return scene[0] + style[0]
