import http.server
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import threading
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from styletrf.curve_chart import Curve
from styletrf.images import write_rgb
from styletrf.page import duration
from styletrf.report import Metric, ReportContent, StageCost, write_report
from styletrf.video import write_video

FULL = ReportContent(
    scene="horns",
    style="mosaic",
    quality="draft",
    summary="24 frames of 64 x 48 pixels.",
    video="video.mp4",
    unstylized_video="unstylized.mp4",
    poster="poster.png",
    style_image="style.png",
    priors=["priors/0.png", "priors/1.png"] * 12,
    curves=[Curve("RadianceField", "PSNR, dB", range(1, 50), np.log(range(1, 50)).tolist())] * 3,
    metrics=[Metric("PSNR", "23.4 dB", "Nearness."), Metric("error", "0.001", "Flicker.", "0.002")],
    stages=[
        StageCost("CameraPoses", 61.0, 2**30, "reused"),
        StageCost("StylizedTrajectory", 7261.0, 3 * 2**30),
    ],
    parameters={"RadianceField": {"rays": 1536, "resolution": [288, 256, 128]}},
    versions={"torch": "2.13.0"},
    digests={"StylizedField": "0123456789abcdef" * 4},
    command="luigi --module tasks StylizedTrajectory --scene horns --style mosaic --long "
    + "x" * 80,
)
EMPTY = ReportContent(scene="horns", style="mosaic", quality="draft")


class Page(HTMLParser):
    """The text, the addresses and the tags of a page."""

    def __init__(self, text):
        super().__init__()
        self.addresses, self.tags, self.words = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.addresses += [v for k, v in attributes if k in ("src", "href", "poster")]

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(self.words)


def written(tmp_path, content):
    write_report(tmp_path / "report.html", content)
    return Page((tmp_path / "report.html").read_text(encoding="utf-8"))


def test_everything_given_is_on_the_page(tmp_path):
    page = written(tmp_path, FULL)
    for words in (
        *("horns", "mosaic", "draft", "24 frames", "23.4 dB", "Flicker.", "0.002", "reused"),
        *(
            "1 min 01 s",
            "2 h 01 min",
            "3.00 GiB",
            "1536",
            "[288, 256, 128]",
            "2.13.0",
            FULL.command,
        ),
        "0123456789abcdef" * 4,
    ):
        assert words in page.text
    assert page.tags.count("svg") == 3
    assert page.tags.count("video") == 2


def test_nothing_leads_out_of_the_folder(tmp_path):
    page = written(tmp_path, FULL)
    named = {
        "video.mp4",
        "unstylized.mp4",
        "poster.png",
        "style.png",
        "priors/0.png",
        "priors/1.png",
    }
    assert set(page.addresses) == named
    assert "//" not in re.sub(r"  // .*", "", (tmp_path / "report.html").read_text())
    assert "link" not in page.tags


def test_an_empty_part_leaves_its_section_out(tmp_path):
    page = written(tmp_path, EMPTY)
    assert not {"section", "video", "img", "svg", "table", "details"} & set(page.tags)
    sections = {
        "Priors": {"priors": ["a.png"]},
        "Metrics": {"metrics": FULL.metrics},
        "Training": {"curves": FULL.curves},
        "Time and memory": {"stages": FULL.stages},
        "How it was made": {"versions": FULL.versions},
        "Make it again": {"command": "luigi"},
    }
    for title, part in sections.items():
        page = written(tmp_path, replace(EMPTY, **part))
        assert title in page.text
        assert page.tags.count("section") == 1


def test_one_video_alone_has_the_browsers_own_controls(tmp_path):
    write_report(tmp_path / "report.html", replace(EMPTY, video="video.mp4"))
    text = (tmp_path / "report.html").read_text()
    assert text.count("<video") == 1
    assert "controls autoplay" in text


HOSTILE = "</title><script>alert(1)</script>\"'><img src=x onerror=alert(2)> $body & ünï"


def test_all_text_is_escaped(tmp_path):
    harmless = written(tmp_path, replace(FULL, priors=["a.png"], curves=[FULL.curves[0]]))
    page = written(
        tmp_path,
        ReportContent(
            scene=HOSTILE,
            style=HOSTILE,
            quality=HOSTILE,
            summary=HOSTILE,
            video='x" onerror="alert(1).mp4',
            unstylized_video="javascript:alert(1)",
            poster="a b.png",
            style_image="<i>.png",
            priors=["'\">.png"],
            curves=[Curve(HOSTILE, HOSTILE, [1.0, 2.0], [1.0, 2.0])],
            metrics=[Metric(HOSTILE, HOSTILE, HOSTILE, HOSTILE)] * 2,
            stages=[StageCost(HOSTILE, 1.0, 1, HOSTILE), StageCost(HOSTILE, 1.0)],
            parameters={HOSTILE: {HOSTILE: HOSTILE, "2": 2}},
            versions={HOSTILE: HOSTILE},
            digests={HOSTILE: HOSTILE},
            command=HOSTILE,
        ),
    )
    assert sorted(set(page.tags)) == sorted(set(harmless.tags))
    assert page.tags.count("script") == 1
    assert page.tags.count("img") == 2
    assert page.text.count(HOSTILE) >= 12
    assert "javascript%3Aalert%281%29" in page.addresses


@pytest.mark.parametrize("name", ["/etc/hostname", "../video.mp4", "a/../../b.mp4"])
def test_files_elsewhere_are_refused(tmp_path, name):
    with pytest.raises(ValueError, match="beside or below"):
        write_report(tmp_path / "report.html", replace(EMPTY, video=name))
    assert list(tmp_path.iterdir()) == []


def test_the_same_content_gives_the_same_bytes(tmp_path):
    for name in "ab":
        write_report(tmp_path / f"{name}.html", FULL)
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

CHROMIUM = shutil.which("chromium")
IN_HEAD = """<script>
const errors = [];
addEventListener("error", (event) => errors.push(event.message || event.target.outerHTML), true);
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));
</script>"""
AT_END = """<script>
const until = async (holds) => { while (!holds()) await new Promise((r) => setTimeout(r, 20)); };
addEventListener("load", async () => {
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
  const root = document.documentElement;
  const overflow = () => root.scrollWidth - root.clientWidth;
  const closed = overflow();
  for (const details of document.querySelectorAll("details")) details.open = true;
  parent.postMessage(JSON.stringify({
    width: innerWidth, overflow: closed, overflowOpen: overflow(), errors, apart,
    inside: [...document.querySelectorAll(".card")].every((c) => c.scrollWidth <= c.clientWidth),
    durations: videos.map((v) => v.duration), sizes: videos.map((v) => v.videoWidth),
    shown: getComputedStyle(document.querySelector(".before")).clipPath,
    broken: [...document.images].filter((i) => i.loading !== "lazy" && !i.naturalWidth).length,
  }), "*");
});
</script>"""
FRAME = """<iframe src="probe.html" style="width:{width}px;height:900px;border:0"
allow="autoplay"></iframe><script>addEventListener("message", (event) =>
fetch("http://127.0.0.1:{port}/", {{method: "POST", mode: "no-cors", body: event.data}}));
</script>"""


@pytest.fixture
def answers():
    received = queue.Queue()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            received.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *args):
            pass

    with http.server.HTTPServer(("127.0.0.1", 0), Handler) as server:
        received.port = server.server_address[1]
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield received
        server.shutdown()
        thread.join()


def answer_of_browser(page, folder, answers):
    flags = ["headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "mute-audio"]
    flags += ["disable-background-networking", "disable-component-update", "disable-sync"]
    flags += ["autoplay-policy=no-user-gesture-required", f"user-data-dir={folder}"]
    flags += [
        "window-size=1400,1000",
        "hide-scrollbars",
        "remote-debugging-port=0",
    ]  # the port keeps it running
    process = subprocess.Popen(
        [CHROMIUM, *(f"--{flag}" for flag in flags), page.as_uri()],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return answers.get(timeout=60)
    except queue.Empty:
        return pytest.fail("the page did not play, pause, and seek both videos within a minute")
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def moving(seed, size=(48, 64), count=24):
    frame = np.random.default_rng(seed).integers(0, 255, (*size, 3), dtype=np.uint8)
    return [np.roll(frame, i, axis=1) for i in range(count)]


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on PATH to open the page in")
@pytest.mark.parametrize("width", [390, 1280])
def test_a_browser_plays_both_videos_and_nothing_overflows(tmp_path, answers, width):
    folder = tmp_path / "out"
    (folder / "priors").mkdir(parents=True)
    write_video(folder / "video.mp4", moving(0), 24)
    write_video(folder / "unstylized.mp4", moving(1), 24)
    for name in ("poster", "style", "priors/0", "priors/1"):
        write_rgb(folder / f"{name}.png", np.full((48, 64, 3), 0.5))
    write_report(folder / "report.html", replace(FULL, scene="a" * 60))
    page = (folder / "report.html").read_text()
    page = page.replace("<head>", "<head>" + IN_HEAD).replace("</body>", AT_END + "</body>")
    (folder / "probe.html").write_text(page)
    (folder / "frame.html").write_text(FRAME.format(width=width, port=answers.port))
    answer = answer_of_browser(folder / "frame.html", tmp_path / "profile", answers)
    assert answer["width"] == width
    assert answer["errors"] == []
    assert (answer["overflow"], answer["overflowOpen"], answer["inside"]) == (0, 0, True)
    assert answer["durations"] == pytest.approx([1.0, 1.0], abs=0.01)
    assert answer["sizes"] == [64, 64]
    assert answer["apart"] < 0.1
    assert answer["shown"] == "inset(0px 80% 0px 0px)"
    assert answer["broken"] == 0
