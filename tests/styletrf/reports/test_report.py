import base64
import re
from dataclasses import replace

import numpy as np
import pytest
from expected_errors import rejects
from headless import answer_of, needs_chromium
from parsed_page import HOSTILE, Page
from small_videos import moving

from styletrf.files.images import read_rgb, write_rgb
from styletrf.files.video import write_video
from styletrf.reports.curve_chart import Curve
from styletrf.reports.embedding import embedded_image
from styletrf.reports.metric_table import Figure, Metric, MetricTable
from styletrf.reports.page import duration
from styletrf.reports.report import ReportContent, StageCost, write_report

EMPTY = ReportContent(scene="horns", style="mosaic", quality="draft")
METRICS = MetricTable(
    "Between frames",
    ["short term", "long term"],
    [Metric("error", "Flicker.", [Figure("0.001", "floor 0.002"), Figure("not measured")])],
)
WORDS = replace(
    EMPTY,
    summary="24 frames of 64 x 48 pixels.",
    curves=[Curve("RadianceField", "PSNR, dB", range(1, 50), np.log(range(1, 50)).tolist())] * 3,
    metrics=[METRICS],
    error_curves=[Curve("Short term", "error", [0, 1], [1.0, 2.0], [0.5, 0.5], "frame")],
    stages=[
        StageCost("CameraPoses", 61.0, 2**30, "reused"),
        StageCost("StylizedTrajectory", 7261.0, 3 * 2**30),
    ],
    parameters={"RadianceField": {"rays": 1536, "resolution": [288, 256, 128]}},
    versions={"torch": "2.13.0"},
    digests={"StylizedField": "0123456789abcdef" * 4},
    command="luigi --module tasks StylizedTrajectory --scene horns --style mosaic --long "
    + "x" * 80,
    viewer_command="luigi --module tasks Viewer --scene horns",
)


@pytest.fixture(scope="session")
def full(tmp_path_factory):
    """All that a page can show, its files included."""
    folder = tmp_path_factory.mktemp("shown")
    write_video(folder / "video.mp4", moving(0), 24)
    write_video(folder / "unstylized.mp4", moving(1), 24)
    for name in ("poster", "style", "prior0", "prior1"):
        write_rgb(folder / f"{name}.png", np.full((48, 64, 3), 0.5, dtype=np.float32))
    return replace(
        WORDS,
        video=folder / "video.mp4",
        unstylized_video=folder / "unstylized.mp4",
        poster=folder / "poster.png",
        style_image=folder / "style.png",
        priors=[folder / "prior0.png", folder / "prior1.png"] * 6,
    )


def written(tmp_path, content):
    write_report(tmp_path / "report.html", content)
    return Page((tmp_path / "report.html").read_text(encoding="utf-8"))


def test_everything_given_is_on_the_page(tmp_path, full):
    page = written(tmp_path, full)
    for words in (
        *("horns", "mosaic", "draft", "24 frames", "Flicker.", "0.001", "floor 0.002", "reused"),
        *("not measured", "1 min 01 s", "2 h 01 min", "3.00 GiB", "1536", "[288, 256, 128]"),
        *("2.13.0", "All in this one file", full.command, "0123456789abcdef" * 4),
        full.viewer_command,
    ):
        assert words in page.text
    assert page.tags.count("svg") == 4
    assert page.tags.count("video") == 2
    assert page.tags.count("img") == 1 + 12


def test_the_page_needs_nothing_beside_it_and_leads_to_its_viewer_alone(tmp_path, full):
    page = written(tmp_path, full)
    assert {address.partition(",")[0] for address in page.addresses} == {
        "data:video/mp4;base64",
        "data:image/jpeg;base64",
        "#walk",
        "../viewer.html#style=mosaic",
    }
    text = re.sub(r"base64,[A-Za-z0-9+/=]+", "", (tmp_path / "report.html").read_text())
    assert "//" not in re.sub(r"  // .*", "", text)
    assert "link" not in page.tags


def test_videos_are_inside_as_they_are(tmp_path, full):
    page = written(tmp_path, full)
    inside = [base64.b64decode(a.partition(",")[2]) for a in page.addresses if "mp4" in a]
    assert inside == [full.video.read_bytes(), full.unstylized_video.read_bytes()]


@pytest.mark.parametrize(("size", "expected"), [((30, 40), (30, 40)), ((300, 1200), (120, 480))])
def test_images_are_inside_small_and_alike(tmp_path, size, expected):
    ramp = np.linspace(0, 1, size[1], dtype=np.float32)
    image = np.broadcast_to(ramp[None, :, None], (*size, 3)).copy()
    write_rgb(tmp_path / "ramp.png", image)
    uri = embedded_image(tmp_path / "ramp.png", 480)
    (tmp_path / "inside.jpg").write_bytes(base64.b64decode(uri.partition(",")[2]))
    inside = read_rgb(tmp_path / "inside.jpg")
    assert inside.shape[:2] == expected
    assert np.abs(inside - np.linspace(0, 1, expected[1])[None, :, None]).max() < 0.03


def test_an_empty_part_leaves_its_section_out(tmp_path, full):
    page = written(tmp_path, EMPTY)
    assert not {"section", "video", "img", "svg", "table", "details"} & set(page.tags)
    sections = {
        "Priors": {"priors": full.priors[:1]},
        "Metrics": {"metrics": full.metrics},
        "Training": {"curves": full.curves},
        "Time and memory": {"stages": full.stages},
        "How it was made": {"versions": full.versions},
        "Make it again": {"command": "luigi"},
        "Walk around in it": {"viewer_command": "luigi"},
    }
    for title, part in sections.items():
        page = written(tmp_path, replace(EMPTY, **part))
        assert title in page.text
        assert page.tags.count("section") == 1


def test_one_video_alone_has_the_browsers_own_controls(tmp_path, full):
    page = written(tmp_path, replace(EMPTY, video=full.video))
    assert (page.tags.count("video"), page.tags.count("input")) == (1, 0)
    assert "controls" in page.named


def test_all_text_is_escaped(tmp_path, full):
    plain = replace(full, priors=(), curves=full.curves[:1])
    harmless = written(tmp_path, plain)
    page = written(
        tmp_path,
        replace(
            plain,
            scene=HOSTILE,
            style=HOSTILE,
            quality=HOSTILE,
            summary=HOSTILE,
            curves=[Curve(HOSTILE, HOSTILE, [1.0, 2.0], [1.0, 2.0], along=HOSTILE)],
            metrics=[
                MetricTable(
                    HOSTILE,
                    [HOSTILE],
                    [Metric(HOSTILE, HOSTILE, [Figure(HOSTILE, HOSTILE)])] * 2,
                )
            ],
            stages=[StageCost(HOSTILE, 1.0, 1, HOSTILE), StageCost(HOSTILE, 1.0)],
            parameters={HOSTILE: {HOSTILE: HOSTILE, "2": 2}},
            versions={HOSTILE: HOSTILE},
            digests={HOSTILE: HOSTILE},
            command=HOSTILE,
            viewer_command=HOSTILE,
        ),
    )
    assert set(page.tags) == set(harmless.tags)
    assert page.tags.count("script") == 1
    assert page.tags.count("img") == 1
    assert page.text.count(HOSTILE) >= 12


def test_what_is_no_video_is_refused_and_leaves_no_page(tmp_path, full):
    with rejects(full.poster.parent):
        write_report(tmp_path / "report.html", replace(EMPTY, video=full.poster.parent))
    assert list(tmp_path.iterdir()) == []


def test_the_same_content_gives_the_same_bytes(tmp_path, full):
    for name in "ab":
        write_report(tmp_path / f"{name}.html", full)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0.0 s"),
        (59.94, "59.9 s"),
        (59.96, "1 min 00 s"),
        (3599.6, "1 h 00 min"),
        (9e4, "25 h 00 min"),
    ],
)
def test_durations_are_said_as_people_say_them(seconds, text):
    assert duration(seconds) == text


# What follows opens the page in a real browser, at the width of a phone and of a desktop.

PROBE = """
  const videos = [...document.querySelectorAll("video")];
  await until(() => videos.every((v) => v.readyState >= 2 && v.currentTime > 0.2));
  document.querySelector("button").click();
  await until(() => videos.every((v) => v.paused && !v.seeking));
  const apart = Math.abs(videos[0].currentTime - videos[1].currentTime);
  const split = document.querySelector(".split");
  split.value = 20;
  split.dispatchEvent(new Event("input"));
  const seek = document.querySelector(".seek");
  seek.value = 0.5;
  seek.dispatchEvent(new Event("input"));
  const middle = (v) => !v.seeking && Math.abs(v.currentTime - v.duration / 2) < 0.03;
  await until(() => videos.every(middle));
  const closed = overflow();
  for (const details of document.querySelectorAll("details")) details.open = true;
  return {
    overflow: closed, overflowOpen: overflow(), apart,
    inside: [...document.querySelectorAll(".card")].every((c) => c.scrollWidth <= c.clientWidth),
    durations: videos.map((v) => v.duration), sizes: videos.map((v) => v.videoWidth),
    shown: getComputedStyle(document.querySelector(".before")).clipPath,
    clock: document.querySelector("output").textContent,
    broken: [...document.images].filter((i) => !i.naturalWidth).length,
  };
"""


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_a_browser_plays_both_videos_and_nothing_overflows(tmp_path, full, width):
    (tmp_path / "mailed").mkdir()
    page = tmp_path / "mailed/report.html"
    write_report(page, replace(full, scene="a" * 60))
    answer = answer_of(page, PROBE, width)
    assert answer["width"] == width
    assert answer["errors"] == []
    assert (answer["overflow"], answer["overflowOpen"], answer["inside"]) == (0, 0, True)
    assert answer["durations"] == pytest.approx([1.0, 1.0], abs=0.01)
    assert answer["sizes"] == [64, 64]
    assert answer["apart"] < 0.1
    assert answer["shown"] == "inset(0px 80% 0px 0px)"
    assert answer["clock"] == "0.5 of 1.0 s"
    assert answer["broken"] == 0


WIDE = """
  const cards = [...document.querySelectorAll(".card")];
  const columns = [...document.querySelectorAll(".metrics :is(thead th, td)")];
  return { overflow: overflow(), inside: cards.every((c) => c.scrollWidth <= c.clientWidth),
           columns: columns.length };
"""


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_long_explanations_beside_figures_hide_no_column(tmp_path, width):
    beside = "floor 0.0012; unstylized frames 0.0034, which show less fine detail (sharpness 0.9)"
    names = ["short term", "7 frames", "long term"]
    metric = Metric("error of warped frames", "Flicker.", [Figure("0.001", beside)] * len(names))
    content = replace(EMPTY, metrics=[MetricTable("Between frames", names, [metric] * 2)])
    write_report(tmp_path / "report.html", content)
    answer = answer_of(tmp_path / "report.html", WIDE, width)
    assert (answer["columns"], answer["overflow"], answer["inside"]) == (10, 0, True)


OFFER = """
  await new Promise((r) => setTimeout(r, 300));
  const shown = (selector) => document.querySelector(selector)?.checkVisibility() ?? false;
  const before = { enter: shown(".enter"), link: shown(".there"), command: shown(".absent") };
  document.querySelector(".enter")?.click();
  const frame = document.querySelector("iframe");
  return { before, frame: frame?.src.split("/").slice(-2).join("/") ?? "", overflow: overflow() };
"""


@needs_chromium
def test_a_viewer_that_shows_the_style_is_offered_and_else_its_command(tmp_path):
    place = tmp_path / "horns/a b#1"
    place.mkdir(parents=True)
    write_report(place / "report.html", replace(WORDS, style="a b#1"))
    answer = answer_of(place / "report.html", OFFER, 390)
    assert answer["before"] == {"enter": False, "link": False, "command": True}
    (tmp_path / "horns/viewer.html").write_text("<!doctype html><p>Walk</p>")
    write_rgb(tmp_path / "horns/viewer.a b#1.jpg", np.full((8, 8, 3), 0.5, dtype=np.float32))
    answer = answer_of(place / "report.html", OFFER, 390)
    assert answer["before"] == {"enter": True, "link": True, "command": False}
    assert (answer["frame"], answer["overflow"]) == ("horns/viewer.html#style=a%20b%231", 0)
