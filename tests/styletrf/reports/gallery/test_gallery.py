"""The gallery of results: every scene in every style, sortable, also in a real browser."""

import json
import unicodedata
from pathlib import Path

import numpy as np
import pytest
from headless import answer_of, needs_chromium
from message_words import mentions
from parsed_page import HOSTILE, Page
from small_videos import moving

from styletrf.files.images import write_rgb
from styletrf.files.video import write_video
from styletrf.reports.gallery.page import write_gallery
from styletrf.reports.gallery.tile import OUTCOME_LABELS, Cell, Score


def scores(psnr, error):
    text = "not measured" if error is None else f"{error} x floor"
    return [Score("PSNR", psnr, f"{psnr} dB", "highest"), Score("short-term", error, text)]


CELLS = [
    Cell("horns", "udnie", has_report=True, quality="draft", scores=scores(26.4, 0.7), look=2),
    Cell("horns", "brush", has_report=True, quality="draft", scores=scores(26.4, None)),
    Cell("fern", "udnie", True, "", scores(25.0, 0.9), outcome="failed", reason="CameraPoses: no"),
    Cell("fern", "mosaic", outcome="failed", reason="StyleImage: there is no such style"),
    Cell("fern", "brush", outcome="under way", reason="StyleNetwork", has_lineage=True),
]


def written(tmp_path: Path, cells, pages=None) -> Page:
    write_gallery(tmp_path / "index.html", cells, pages)
    return Page((tmp_path / "index.html").read_text())


def test_what_was_made_or_requested_has_a_tile_and_nothing_else(tmp_path: Path):
    page = written(tmp_path, CELLS)
    assert page.tags.count("li") == len(CELLS)  # of 2 scenes in 3 styles
    assert mentions(page.text, 3, 2, 1)  # made, failed, under way
    for words in ("0.7 x floor", "CameraPoses: no"):
        assert words in page.text
    assert CELLS[3].reason in page.text
    assert f"{OUTCOME_LABELS['failed']}; " in page.text


def test_a_gallery_links_only_files_below_itself(tmp_path: Path):
    odd = Cell("javascript:x", "../a b", has_report=True, look=1, has_lineage=True)
    for address in written(tmp_path, [*CELLS, odd], {"a:b": {"Title": "c/d.html"}}).addresses:
        scene, *folders, file = address.split("/")
        assert file.partition("#")[0] in (
            *("poster.png", "style.png", "report.html", "viewer.html", "lineage.html", "d.html"),
        )
        assert ":" not in address
        assert {scene, *folders}.isdisjoint({"", "..", "."})


def test_a_viewer_opens_at_its_painting_and_is_a_result_of_its_own(tmp_path: Path):
    beside = written(tmp_path, [Cell("a b", "x", has_report=True, look=3)])
    assert {"a%20b/x/report.html", "a%20b/viewer.html#style=x"} <= set(beside.addresses)
    alone = written(tmp_path, [Cell("a b", "x", look=3)])
    assert "a%20b/viewer.html#style=x" in alone.addresses
    assert "a%20b/viewer.x.jpg" in alone.addresses
    assert "report.html" not in "".join(alone.addresses)
    without = written(tmp_path, [Cell("a b", "x", has_report=True)])
    assert "viewer" not in "".join(without.addresses)


def test_markup_in_names_of_a_gallery_stays_text(tmp_path: Path):
    harmless = written(tmp_path, CELLS[2:3])
    text = [Score(HOSTILE, 1.0, HOSTILE), Score("PSNR", 1.0, "x")]
    hostile = Cell(HOSTILE, HOSTILE, True, HOSTILE, text, outcome="failed", reason=HOSTILE)
    page = written(tmp_path, [hostile])
    assert sorted(page.tags) == sorted(harmless.tags)
    assert page.text.count(HOSTILE) >= 4
    with_pages = written(tmp_path, [hostile], {HOSTILE: {"Lineage": "lineage.html"}})
    assert set(with_pages.tags) - set(page.tags) == {"section", "tbody", "tr", "th", "td"} - set(
        page.tags
    )


def test_the_same_cells_give_the_same_bytes_in_any_order(tmp_path: Path):
    write_gallery(tmp_path / "a.html", CELLS)
    write_gallery(tmp_path / "b.html", CELLS[::-1])
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_nothing_at_all_is_a_page_too(tmp_path: Path):
    assert "Nothing yet." in written(tmp_path, []).text


PROBE = """
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const names = () => all(".tile").map(({ dataset }) => dataset.scene[0] + dataset.style[0]);
  const field = (name) => document.querySelector(".controls").elements.namedItem(name);
  const set = (name, value) => {
    field(name).value = value;
    field(name).dispatchEvent(new Event("input", { bubbles: true }));
    return names();
  };
  const reverse = () => { document.querySelector(".direction").click(); return names(); };
  const orders = {};
  for (const key of ["scene", "style", "PSNR", "short-term"]) {
    orders[key] = set("key", key);
    orders[key + " reversed"] = reverse();
    reverse();
  }
  set("key", "scene");
  const found = {};
  for (const [name, value] of [["words", "HORN  ud"], ["scene", "=fern"], ["style", "=brush"],
    ["state", "problem"], ["measure", "short-term"], ["words", "no such thing"]]) {
    found[value] = set(name, value);
    set(name, "");
  }
  set("measure", "PSNR");
  found.low = set("low", "26");
  set("low", "");
  found.high = set("high", "26");
  set("high", "");
  set("measure", "");

  const horns = document.querySelector('.tile[data-scene="horns"][data-style="udnie"]');
  const videos = () => all(".tile video");
  const canHover = matchMedia("(hover: hover)").matches;
  let alone = true;
  if (canHover) {
    const before = videos().length;
    horns.querySelector("h2 a").focus();
    await until(() => videos().length === 1 && videos()[0].currentTime > 0.1);
    horns.querySelector("h2 a").blur();
    await until(() => !videos().length);
    alone = before === 0;
    document.querySelector(".play-all").click();
  }
  horns.scrollIntoView({ block: "center" });
  await until(() => horns.querySelector("video")?.currentTime > 0.1);

  const boxes = all(".choose");
  boxes[0].click();
  const early = document.querySelector(".chosen .open").disabled;
  boxes[1].click();
  boxes[2].click();
  document.querySelector(".chosen .open").click();
  const dialog = document.querySelector("dialog"), pair = all("video", dialog);
  await until(() => pair.every((video) => video.readyState >= 2));
  const seek = dialog.querySelector(".seek");
  seek.value = 0.5;
  seek.dispatchEvent(new Event("input"));
  const isHalfway = (v) => !v.seeking && Math.abs(v.currentTime / v.duration - 0.5) < 0.03;
  await until(() => pair.every((video) => video.paused && isHalfway(video)));
  const texts = (selector, root = dialog) => all(selector, root).map((each) => each.textContent);
  const compared = {
    early, titles: texts("figcaption"), better: texts(".better"),
    rows: all("tbody tr", dialog).map((row) => texts("*", row)),
    overflow: overflow(), isOpen: dialog.open,
  };
  dialog.querySelector(".close").click();
  document.querySelector(".chosen .clear").click();
  compared.isCleared = !all(".choose:checked").length && document.querySelector(".chosen").hidden;
  return { orders, found, alone, compared, overflow: overflow() };
"""
ORDERS = {
    "scene": ["fb", "fm", "fu", "hb", "hu"],
    "scene reversed": ["hb", "hu", "fb", "fm", "fu"],
    "style": ["fb", "hb", "fm", "fu", "hu"],
    "style reversed": ["fu", "hu", "fm", "fb", "hb"],
    "PSNR": ["hb", "hu", "fu", "fb", "fm"],
    "PSNR reversed": ["fu", "hb", "hu", "fb", "fm"],
    "short-term": ["hu", "fu", "fb", "fm", "hb"],
    "short-term reversed": ["fu", "hu", "fb", "fm", "hb"],
}
FOUND = {
    "HORN  ud": ["hu"],
    "=fern": ["fb", "fm", "fu"],
    "=brush": ["fb", "hb"],
    "problem": ["fb", "fm"],
    "short-term": ["fu", "hu"],
    "no such thing": [],
    "low": ["hb", "hu"],
    "high": ["fu"],
}


def with_files(folder: Path, cells) -> None:
    for cell in cells:
        place = folder / cell.scene / cell.style
        place.mkdir(parents=True)
        write_video(place / "video.mp4", moving(0), 24)
        for name in ("poster", "style"):
            write_rgb(place / f"{name}.png", np.full((48, 64, 3), 0.5, dtype=np.float32))


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_a_browser_sorts_filters_plays_and_compares(tmp_path: Path, width: int):
    with_files(tmp_path, CELLS[:3])
    write_gallery(tmp_path / "index.html", CELLS)
    answer = answer_of(tmp_path / "index.html", PROBE, width)
    assert answer["errors"] == []
    for name, expected in (("orders", ORDERS), ("found", FOUND)):
        assert answer.get(name) == expected, answer.get("probe")
    assert (answer["alone"], answer["overflow"]) == (True, 0)
    compared = answer["compared"]
    assert compared["titles"] == ["horns · brush", "horns · udnie"], "a third replaces the first"
    assert compared["rows"][0] == ["PSNR", "26.4 dB", "26.4 dB"]
    assert compared["rows"][1] == ["short-term", "not measured", "0.7 x floor"]
    assert compared["better"] == [], "equal, and unknown"
    assert (compared["early"], compared["isOpen"], compared["isCleared"]) == (True, True, True)
    assert compared["overflow"] == 0


SEARCHED = """
  const words = document.querySelector("[name=words]");
  return { found: TYPED.map((typed) => {
    words.value = typed;
    words.dispatchEvent(new Event("input", { bubbles: true }));
    return document.querySelectorAll(".tile").length;
  }) };
"""


@needs_chromium
def test_names_are_found_however_their_accents_are_stored_and_typed(tmp_path: Path):
    """macOS stores letters and accents apart, and no keyboard types them so."""
    forms = [unicodedata.normalize(form, "Caf\u00e9") for form in ("NFC", "NFD")]
    cells = [Cell(form, "x", has_report=True) for form in forms]
    with_files(tmp_path, cells)
    write_gallery(tmp_path / "index.html", cells)
    probe = SEARCHED.replace("TYPED", json.dumps([*forms, "other"]))
    answer = answer_of(tmp_path / "index.html", probe, 1280)
    assert (answer["errors"], answer["found"]) == ([], [2, 2, 0])


MANY = """
  const held = () => document.querySelectorAll(".tile").length;
  const before = held();
  const words = document.querySelector("[name=words]");
  words.value = "scene07 style1";
  words.dispatchEvent(new Event("input", { bubbles: true }));
  const found = held(), count = document.querySelector(".count").textContent;
  words.value = "";
  words.dispatchEvent(new Event("input", { bubbles: true }));
  const seen = new Set();
  while (seen.size < 2000) {
    scrollTo(0, document.body.scrollHeight);
    for (const { dataset } of document.querySelectorAll(".tile"))
      seen.add(dataset.scene + dataset.style);
    await new Promise((r) => setTimeout(r, 20));
  }
  return { before, found, count, seen: seen.size };
"""


@needs_chromium
def test_of_two_thousand_results_it_holds_those_near_and_scrolling_reaches_all(tmp_path: Path):
    cells = [
        Cell(f"scene{scene:02}", f"style{style:02}", has_report=True, scores=scores(scene, style))
        for scene in range(100)
        for style in range(20)
    ]
    with_files(tmp_path, cells[:1])
    write_gallery(tmp_path / "index.html", cells)
    answer = answer_of(tmp_path / "index.html", MANY, 1280)
    assert answer["before"] < 400
    assert (answer["found"], answer["seen"]) == (10, 2000)
    assert answer["count"].startswith("10 of 2000")
