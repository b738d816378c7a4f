"""The page runs its own script alone, whatever names say, and reports what is wrong with it."""

import base64
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from headless import needs_chromium, page_text
from message_words import mentions
from served_folder import served_folder
from shared_browser import answer_of, opened
from written_viewers import written, written_small

HOSTILE = "</script><script>ran=1</script>\"'><img src=x onerror=ran=2> $body & ünï"


class Tags(HTMLParser):
    """The tags of a page with their attributes, and the text outside of scripts."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.text = ""
        self.feed(page_text(page))

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, data):
        if self.tags and self.tags[-1][0] not in ("script", "style"):
            self.text += data


def hostile(content):
    looks = [replace(look, name=HOSTILE) for look in content.looks]
    return replace(content, scene=HOSTILE, looks=looks)


def test_markup_in_names_of_a_viewer_stays_text(content, tmp_path):
    harmless = Tags(written(content("ndc"), tmp_path / "a.html"))
    page = written(hostile(content("ndc")), tmp_path / "b.html")
    found = Tags(page)
    assert [tag for tag, _ in found.tags] == [tag for tag, _ in harmless.tags]
    assert found.text.count(HOSTILE) >= 3
    inside = re.search(r'id="scene">(.*?)</script>', page_text(page), re.S)
    assert json.loads(inside[1])["looks"][1]["name"] == HOSTILE


USED = """
  const { choose, chosen } = await viewer, find = (what) => document.querySelector(what);
  for (const id of ["halve", "save", "addKey", "preview", "play", "play"]) find(`#${id}`).click();
  choose(2);
  await until(() => location.hash.includes("style="));
  const texts = (selector) => [...document.querySelectorAll(selector)].map((e) => e.textContent);
  const made = document.querySelectorAll("main script, main img[onerror]").length;
  return { names: texts("h1, #looks span, #left"), made, hasRun: "ran" in window };
"""


@needs_chromium
def test_no_script_of_a_name_runs_in_a_browser(content, tmp_path):
    page = written_small(hostile(content("ndc")), tmp_path / "viewer.html")
    with opened(page.as_uri()) as shown:
        answer = shown.run(USED)
        assert shown.errors == []
    assert answer["names"] == [HOSTILE] * 5
    assert (answer["made"], answer["hasRun"]) == (0, False)


def test_the_policy_allows_the_one_script_and_no_network(content, tmp_path):
    page = written(content("ndc"), tmp_path / "a.html")
    scripts = re.findall(r"<script>(.*?)</script>", page_text(page), re.S)
    assert len(scripts) == 1
    digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
    policy = next(a["content"] for tag, a in Tags(page).tags if a.get("http-equiv"))
    assert policy.startswith(f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'sha")
    assert "http" not in policy
    assert "unsafe" not in policy


def test_the_same_content_gives_the_same_bytes(content, tmp_path):
    pages = [written(content("ndc"), tmp_path / f"{name}.html").read_bytes() for name in "ab"]
    assert pages[0] == pages[1]


def test_the_density_is_there_once_and_coarser_lattices_are_named(content, tmp_path):
    baked = content("ndc")
    one = written(replace(baked, looks=baked.looks[:1]), tmp_path / "a.html")
    both = written(replace(baked, looks=baked.looks[:1] * 2), tmp_path / "b.html")
    assert both.stat().st_size - one.stat().st_size < 2000
    coarse = replace(baked.density, reduced_from=(300, 200, 100), psnr_db=41.26)
    look = replace(baked.looks[0], reduced_from=(400, 300, 150), psnr_db=33.33)
    reduced = replace(baked, density=coarse, looks=[look])
    page = Tags(written(reduced, tmp_path / "c.html"))
    for points, loss in (("300 x 200 x 100", "41.3"), ("400 x 300 x 150", "33.3")):
        assert mentions(page.text, points, f"{loss} dB")


NOTICE = """
  await viewer.catch(() => {});
  const notice = document.querySelector("#notice");
  return { notice: notice.hidden ? "" : notice.textContent };
"""
WITHOUT_WEBGL = "<script>HTMLCanvasElement.prototype.getContext = () => null;</script>"
SMALL_TEXTURES = """<script>
const parameter = WebGL2RenderingContext.prototype.getParameter;
WebGL2RenderingContext.prototype.getParameter = function (name) {
  return name === this.MAX_3D_TEXTURE_SIZE ? 8 : parameter.call(this, name);
};
</script>"""
NO_MEMORY = """<script>
WebGL2RenderingContext.prototype.getError = function () { return this.OUT_OF_MEMORY; };
</script>"""


def with_script(script: str):
    return lambda text: text.replace("<head>", "<head>" + script)


SHOWN = """
  await until(() => / ms/.test(document.querySelector("#status").textContent));
  return document.querySelector("#notice").hidden;
"""


@needs_chromium
@pytest.mark.parametrize("encoding", ["utf-16", "utf-8"])
def test_a_page_that_a_program_saved_again_is_shown(content, tmp_path, encoding):
    page = written_small(content("ndc"), tmp_path / "viewer.html")
    page.write_bytes(page_text(page).encode(encoding))
    with opened(page.as_uri()) as shown:
        assert shown.run(SHOWN)
        assert shown.errors == []


@needs_chromium
def test_a_page_is_shown_though_its_server_says_that_all_pages_are_in_utf_8(content, tmp_path):
    written_small(content("ndc"), tmp_path / "viewer.html")
    with served_folder(tmp_path) as address, opened(f"{address}/viewer.html") as shown:
        assert shown.run(SHOWN)
        assert shown.errors == []


@needs_chromium
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[: -len(text) // 3], "This file is incomplete"),
        (with_script(WITHOUT_WEBGL), "This viewer needs WebGL2"),
        (with_script(SMALL_TEXTURES), "larger than the graphics card's textures"),
        (with_script(NO_MEMORY), "too little memory for this scene"),
        (lambda text: re.sub(r'(id="data-\w+">.).{20}', r"\1" + "A" * 20, text), "is damaged"),
    ],
    ids=["truncated", "without WebGL2", "small textures", "no memory", "damaged"],
)
def test_a_page_that_cannot_be_shown_says_why(content, tmp_path, change, message):
    page = written_small(content("ndc"), tmp_path / "viewer.html")
    page.write_text(change(page_text(page)), encoding="utf-16")
    answer = answer_of(page, NOTICE, 1000)
    assert message in answer["notice"]
    assert answer["errors"] == []


LOST = """
  const { loop } = await viewer, notice = document.querySelector("#notice");
  await until(() => loop.isSettled());
  document.querySelector("canvas").getContext("webgl2").getExtension("WEBGL_lose_context").loseContext();
  await until(() => !notice.hidden);
  return notice.textContent;
"""


@needs_chromium
def test_a_page_whose_graphics_card_gives_up_says_so(content, tmp_path):
    page = written_small(content("ndc"), tmp_path / "viewer.html")
    with opened(page.as_uri()) as shown:
        assert shown.run(LOST).strip()
