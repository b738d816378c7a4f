"""A page shows more paintings than the graphics card holds, and goes on if one has no room."""

from dataclasses import replace
from pathlib import Path

import pytest
from headless import needs_chromium, with_text
from message_words import mentions
from shared_browser import opened
from written_viewers import written_small

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
  const { renderer, scene, chosen, loop, picture } = await viewer;
  const find = (what) => document.querySelector(what);
  await until(() => loop.isSettled());
  const state = () => ({
    held: scene.looks.map((_, k) => renderer.isLoaded(k)), shown: chosen.a,
    visible: picture(1, 1).a, checked: +find("#looks input:checked").value,
    notice: !find("#notice").hidden,
    report: find("#report").hidden ? "" : find("#report").textContent,
  });
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
    return written_small(many, tmp_path_factory.mktemp("viewer") / "viewer.html")


@pytest.fixture(scope="module")
def sizes(page) -> list[int]:
    """Returns the bytes of each look's textures."""
    with opened(page.as_uri()) as shown:
        return shown.run(SIZES)


def with_budget(page: Path, copy: Path, room: int) -> Path:
    with_text(page, copy, '"mostBytes": 512000000', f'"mostBytes": {room}')
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
        status = shown.run("return document.querySelector('#status').textContent;")
        assert mentions(status, "3 of 4")
        assert shown.errors == []
    assert (begin["held"], begin["report"]) == ([True, True, True, False], "")
    assert last["held"] == [True, True, False, True]
    assert last["visible"] == last["shown"] == last["checked"] == 3
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
    assert state["visible"] == state["shown"] == state["checked"] == 1
    assert not state["notice"]
    assert mentions(state["report"], "style 2")


@pytest.mark.parametrize("limited", [with_budget, with_card])
def test_with_room_for_two_paintings_every_painting_is_shown_in_turn(
    page, sizes, tmp_path, limited
):
    """Photographs that had no room, and that nobody saw, forbade every other painting."""
    with opened(limited(page, tmp_path / "viewer.html", sizes[1] + sizes[2]).as_uri()) as shown:
        begin = shown.run(STATE + "return state();")
        states = [shown.run(CHOSEN.replace("NUMBER", str(k))) for k in (2, 3, 1)]
        assert shown.errors == []
    assert begin["held"] == [False, True, True, False]
    assert [state["visible"] for state in states] == [2, 3, 1]
    for state in states:
        assert (sum(state["held"]), state["report"], state["notice"]) == (2, "", False)


MIXED = (
    STATE
    + """
  const isDone = () => !find("#report").textContent.startsWith("Loading");
  find("#share").value = 0.5;
  find("#share").dispatchEvent(new Event("input"));
  await until(isDone);
  const mixed = { ...state(), share: chosen.share, text: find("#shareText").value };
  find("#halve").click();
  await until(isDone);
  return [mixed, { ...state(), share: chosen.share, isSplit: !find("#sides").hidden }];
"""
)


def test_photographs_without_room_are_not_mixed_and_the_page_says_so(page, sizes, tmp_path):
    """Their name stood beside a split that showed the painting on both sides."""
    with opened(with_budget(page, tmp_path / "viewer.html", sizes[1]).as_uri()) as shown:
        mixed, split = shown.run(MIXED)
        assert shown.errors == []
    for state in (mixed, split):
        assert mentions(state["report"], "Photographs")
        assert (state["share"], state["shown"]) == (1, 1)
    assert mixed["text"] == "100 % style 1"
    assert not split["isSplit"]


def test_photographs_that_nobody_sees_give_way_and_come_back_to_be_mixed(page, sizes, tmp_path):
    room = sizes[0] + sizes[1]
    with opened(with_budget(page, tmp_path / "viewer.html", room).as_uri()) as shown:
        begin = shown.run(STATE + "return state();")
        other = shown.run(CHOSEN.replace("NUMBER", "2"))
        mixed, _ = shown.run(MIXED)
        assert shown.errors == []
    assert begin["held"] == [True, True, False, False]
    assert (other["visible"], other["held"]) == (2, [False, True, True, False])
    assert (mixed["share"], mixed["held"]) == (0.5, [True, False, True, False])


HASTY = (
    STATE
    + """
  const { choose } = await viewer;
  choose(3);
  choose(2);
  location.hash = "style=again&with=style+2&share=0.5";
  await until(() => chosen.a === 3);
  choose(1);
  await until(() => !find("#report").textContent.startsWith("Loading"));
  await new Promise((r) => setTimeout(r, 300));
  return state();
"""
)


def test_what_was_chosen_last_is_shown_whatever_was_chosen_while_it_was_loading(
    page, sizes, tmp_path
):
    """A painting gave way to one that was no longer wanted, and the page stopped."""
    room = sum(sizes[:3])
    with opened(with_budget(page, tmp_path / "viewer.html", room).as_uri()) as shown:
        state = shown.run(HASTY)
        assert shown.errors == []
    assert state["visible"] == state["checked"] == 1
    assert (state["notice"], state["report"]) == (False, "")


EARLY = """<script>
const card = WebGL2RenderingContext.prototype, { texSubImage3D } = card;
card.texSubImage3D = function (...words) {
  if (words[8] === this.RGBA) {  // colors of the first look
    card.texSubImage3D = texSubImage3D;
    for (const k of [0, 1, 3]) document.querySelectorAll("#looks input")[k].click();
  }
  return texSubImage3D.apply(this, words);
};
</script>"""


def test_a_painting_that_is_chosen_before_the_first_picture_is_shown(page, tmp_path):
    """The page stopped, because it drew a painting that was not there."""
    copy = tmp_path / "viewer.html"
    with_text(page, copy, "<head>", "<head>" + EARLY)
    with opened(f"{copy.as_uri()}#style=style+2") as shown:
        state = shown.run(
            STATE + "await until(() => find('#report').hidden && renderer.isLoaded(chosen.a));"
            "return state();"
        )
        assert shown.errors == []
    assert state["visible"] == state["checked"] == 3
    assert not state["notice"]
