"""A page shows more paintings than the graphics card holds, and goes on if one has no room."""

from dataclasses import replace
from pathlib import Path

import pytest
from headless import needs_chromium, opened, with_text
from written_viewers import written

pytestmark = needs_chromium
SIZES = """
  const { scene, renderer } = await viewer;
  return Promise.all(scene.looks.map((_, k) => renderer.sizeOfLook(k)));
"""
CARD = """<script>
const card = WebGL2RenderingContext.prototype, sizes = new Map();
const { bindTexture, texImage3D, deleteTexture } = card;
let bound = null;
card.bindTexture = function (kind, texture) {
  bound = texture;
  return bindTexture.call(this, kind, texture);
};
card.texImage3D = function (...words) {
  const [, , format, width, height, depth] = words;
  if (format === this.RGBA8 && width > 1) sizes.set(bound, 4 * width * height * depth);
  return texImage3D.apply(this, words);
};
card.deleteTexture = function (texture) {
  sizes.delete(texture);
  return deleteTexture.call(this, texture);
};
card.getError = function () {
  const held = [...sizes.values()].reduce((sum, size) => sum + size, 0);
  return held > ROOM ? this.OUT_OF_MEMORY : this.NO_ERROR;
};
</script>"""
STATE = """
  const { renderer, scene, shown, loop } = await viewer;
  const find = (what) => document.querySelector(what);
  await until(() => loop.isSettled());
  const state = () => ({ held: scene.looks.map((_, k) => renderer.isLoaded(k)), shown: shown.a,
    checked: +find("#looks input:checked").value, notice: !find("#notice").hidden,
    report: find("#report").hidden ? "" : find("#report").textContent });
"""
CHOSEN = (
    STATE
    + """
  find(`#looks label:nth-child(${NUMBER + 1}) input`).click();
  await until(() => !find("#report").textContent.startsWith("Loading"));
  return state();
"""
)
DRAWN = """
  const { renderer, picture } = await viewer;
  renderer.draw({ ...picture(32, 24), width: 32, height: 24 });
  return renderer.read();
"""


@pytest.fixture(scope="module")
def page(content, tmp_path_factory) -> Path:
    """Returns a viewer of the photographs and three paintings, of which the last is the first."""
    baked = content("box")
    again = replace(baked.looks[1], name="again")
    many = replace(baked, looks=[*baked.looks, again])
    return written(many, tmp_path_factory.mktemp("viewer") / "viewer.html")


@pytest.fixture(scope="module")
def sizes(page) -> list[int]:
    """Returns the bytes of each look's textures."""
    with opened(page.as_uri()) as shown:
        return shown.run(SIZES)


def with_budget(page: Path, copy: Path, room: int) -> Path:
    with_text(page, copy, '"mostBytes": 536870912', f'"mostBytes": {room}')
    return copy


def with_card(page: Path, copy: Path, room: int) -> Path:
    with_text(page, copy, "<head>", "<head>" + CARD.replace("ROOM", str(room)))
    return copy


@pytest.mark.parametrize("limited", [with_budget, with_card])
def test_a_painting_without_room_takes_the_place_of_one_that_is_not_shown(
    page, sizes, tmp_path, limited
):
    with opened(limited(page, tmp_path / "viewer.html", sum(sizes) - 1).as_uri()) as shown:
        begin = shown.run(STATE + "return state();")
        first = shown.run(DRAWN)
        last = shown.run(CHOSEN.replace("NUMBER", "3"))
        assert shown.run(DRAWN) == first
        assert "3 of 4 looks" in shown.run("return document.querySelector('#status').textContent;")
        assert shown.errors == []
    assert (begin["held"], begin["report"]) == ([True, True, True, False], "")
    assert last["held"] == [True, True, False, True]
    assert last["shown"] == last["checked"] == 3
    assert (last["notice"], last["report"]) == (False, "")


@pytest.mark.parametrize("limited", [with_budget, with_card])
def test_a_page_with_room_for_one_painting_shows_it_and_says_so_of_others(
    page, sizes, tmp_path, limited
):
    """The whole page was refused, though its first painting was shown already."""
    with opened(limited(page, tmp_path / "viewer.html", sizes[1]).as_uri()) as shown:
        first = shown.run(DRAWN)
        state = shown.run(CHOSEN.replace("NUMBER", "2"))
        assert shown.run(DRAWN) == first
        assert shown.errors == []
    assert state["held"] == [False, True, False, False]
    assert state["shown"] == state["checked"] == 1
    assert not state["notice"]
    assert "too little memory for style 2 beside what is shown" in state["report"]


def test_the_painting_that_was_chosen_last_is_shown(page, sizes, tmp_path):
    """One that is loaded is chosen while another one is loading."""
    with opened(with_budget(page, tmp_path / "viewer.html", sum(sizes) - 1).as_uri()) as shown:
        state = shown.run(
            STATE + "const { choose } = await viewer, both = [choose(3), choose(2)];"
            "await Promise.all(both); return state();"
        )
        assert shown.errors == []
    assert state["shown"] == state["checked"] == 2
    assert state["report"] == ""
