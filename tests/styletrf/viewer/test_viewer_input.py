"""Mouse, fingers and keys move the view as the page describes, by events of the browser."""

import json
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest
from headless import OpenPage, needs_chromium, opened
from written_viewers import written_small

pytestmark = needs_chromium
SHIFT = 8  # of the modifiers that the browser's protocol counts
START_PX = (400.0, 300.0)


class View(NamedTuple):
    """Where the camera is; angles in radians."""

    center: np.ndarray
    yaw: float
    pitch: float
    roll: float
    zoom: float


@pytest.fixture(scope="module")
def pages(content, tmp_path_factory) -> Iterator[dict[int, OpenPage]]:
    """Returns the same viewer on a desktop and on a phone, by the width of the window."""
    page = written_small(content("ndc"), tmp_path_factory.mktemp("viewer") / "viewer.html")
    with opened(page.as_uri()) as desktop, opened(page.as_uri(), 390) as phone:
        for each in (desktop, phone):
            each.run("await viewer;")
        yield {1000: desktop, 390: phone}


@pytest.fixture
def desktop(pages) -> Iterator[OpenPage]:
    """Returns the page where it began, with the keyboard on the picture."""
    yield from begun(pages[1000])


@pytest.fixture
def phone(pages) -> Iterator[OpenPage]:
    yield from begun(pages[390])


BEGINNING = """
  const { chosen, refresh } = await viewer, find = (what) => document.querySelector(what);
  if (document.fullscreenElement) await document.exitFullscreen();
  find("#canvas").blur();  // releases held keys
  find("#reset").click();
  Object.assign(chosen, { a: 1, b: 0, share: 1, split: -1 });
  refresh();
  find("#canvas").focus();
"""


def begun(page: OpenPage) -> Iterator[OpenPage]:
    page.run(BEGINNING)
    yield page
    assert page.errors == []


def seen(page: OpenPage) -> View:
    text = page.run("return (await viewer).navigation.toText();")
    *center, yaw, pitch, roll, zoom = map(float, text.split(","))
    return View(np.array(center), yaw, pitch, roll, zoom)


def axes(page: OpenPage) -> np.ndarray:
    """Returns right, down and ahead of the camera as columns."""
    pose = page.run("return (await viewer).navigation.pose();")
    return np.reshape(pose, (3, 4))[:, :3]


def moved(before: View, after: View, frame: np.ndarray) -> np.ndarray:
    """Returns the direction of the way to the right, down and ahead."""
    way = (after.center - before.center) @ frame
    return way / np.linalg.norm(way)


def on_picture(page: OpenPage, at=START_PX) -> dict[str, float]:
    """Returns a place in the picture as one in the window."""
    box = page.run(
        "const { x, y } = document.querySelector('#canvas').getBoundingClientRect();"
        "return { x, y };"
    )
    return {"x": box["x"] + at[0], "y": box["y"] + at[1]}


def drag(page: OpenPage, by_px: tuple[float, float], button: str = "left", modifiers: int = 0):
    start = on_picture(page)
    end = {"x": start["x"] + by_px[0], "y": start["y"] + by_px[1]}
    buttons = {"left": 1, "right": 2}[button]
    words = {"button": button, "buttons": buttons, "modifiers": modifiers, "clickCount": 1}
    page.command("Input.dispatchMouseEvent", type="mousePressed", **start, **words)
    page.command("Input.dispatchMouseEvent", type="mouseMoved", **end, **words)
    page.command("Input.dispatchMouseEvent", type="mouseReleased", **end, **words | {"buttons": 0})


def touch(page: OpenPage, kind: str, *points_px: tuple[float, float], first: int = 0) -> None:
    """Sends what fingers do, numbered from `first`; an end without any lifts all."""
    points = [on_picture(page, at) | {"id": first + k} for k, at in enumerate(points_px)]
    page.command("Input.dispatchTouchEvent", type=kind, touchPoints=points)


def key(page: OpenPage, name: str, kind: str) -> None:
    """Sends a key to the element that has the focus."""
    code = {" ": "Space"}.get(name, name if len(name) > 1 else f"Key{name.upper()}")
    text = {"text": name} if len(name) == 1 and kind == "keyDown" else {}
    page.command("Input.dispatchKeyEvent", type=kind, key=name, code=code, **text)


def press(page: OpenPage, name: str) -> None:
    key(page, name, "keyDown")
    key(page, name, "keyUp")


def wheel(page: OpenPage, place: dict[str, float], by_px: float) -> None:
    words = {"type": "mouseWheel", "deltaX": 0, "deltaY": by_px}
    page.command("Input.dispatchMouseEvent", **place, **words)


def test_a_wheel_zooms_both_ways_and_does_not_scroll(desktop):
    desktop.run("document.body.style.height = '3000px';")
    begin, place = seen(desktop), on_picture(desktop)
    for delta in (-300, 200):
        before = json.dumps(desktop.run("return (await viewer).navigation.toText();"))
        wheel(desktop, place, delta)
        desktop.run(
            f"const {{ navigation: n }} = await viewer; await until(() => n.toText() !== {before});"
        )
    end = seen(desktop)
    assert end.zoom == pytest.approx(np.exp(0.0015 * 100), rel=1e-4)
    assert desktop.run("return scrollY;") == 0
    np.testing.assert_array_equal(end.center, begin.center)
    wheel(desktop, {"x": 500, "y": 850}, 200)  # below the picture
    desktop.run("await until(() => scrollY > 0);")
    desktop.run("document.body.style.height = ''; scrollTo(0, 0);")


PIVOT = """
  const { scene, navigation } = await viewer, pose = navigation.pose();
  const [ahead, center] = [2, 3].map((k) => [0, 4, 8].map((i) => pose[i + k]));
  const depth = scene.focus.reduce((sum, v, i) => sum + (v - center[i]) * ahead[i], 0);
  return center.map((v, i) => v + Math.max(scene.radius, depth) * ahead[i]);
"""


@pytest.mark.parametrize(("by_px", "way"), [((40, 0), (-1, 0, 0)), ((0, 30), (0, -1, 0))])
def test_a_drag_turns_about_what_is_seen_which_follows_the_hand(desktop, by_px, way):
    begin, frame, pivot = seen(desktop), axes(desktop), np.array(desktop.run(PIVOT))
    drag(desktop, by_px)
    end = seen(desktop)
    assert moved(begin, end, frame) @ way > 0.9  # the camera, against the hand
    ahead = (pivot - end.center) / np.linalg.norm(pivot - end.center)
    assert ahead @ axes(desktop)[:, 2] > 1 - 1e-9
    apart = [np.linalg.norm(pivot - each.center) for each in (begin, end)]
    assert apart[1] == pytest.approx(apart[0], rel=1e-4)


def test_the_line_of_a_split_follows_the_hand(desktop):
    press(desktop, "x")
    box = desktop.run(
        "const { x, y, width, height } = document.querySelector('#split').getBoundingClientRect();"
        "return { x: x + width / 2, y: y + height / 2, width };"
    )
    place, words = {"x": box["x"], "y": box["y"]}, {"button": "left", "clickCount": 1}
    desktop.command("Input.dispatchMouseEvent", type="mousePressed", **place, **words, buttons=1)
    place["x"] -= box["width"] / 4
    desktop.command("Input.dispatchMouseEvent", type="mouseMoved", **place, **words, buttons=1)
    desktop.command("Input.dispatchMouseEvent", type="mouseReleased", **place, **words)
    edge = (
        "const edge = document.querySelector('#edge').getBoundingClientRect();"
        "const stage = document.querySelector('#stage').getBoundingClientRect();"
        "return [(await viewer).chosen.split, (edge.x + edge.width / 2 - stage.x) / stage.width];"
    )
    fraction, shown_at = desktop.run(edge)
    assert fraction == pytest.approx(0.25, abs=0.02)
    assert shown_at == pytest.approx(fraction, abs=0.005)


@pytest.mark.parametrize(("button", "modifiers"), [("left", SHIFT), ("right", 0)])
@pytest.mark.parametrize(("by_px", "way"), [((30, 0), (-1, 0, 0)), ((0, 30), (0, -1, 0))])
def test_shift_or_the_right_button_slides_with_the_hand(desktop, button, modifiers, by_px, way):
    begin, frame = seen(desktop), axes(desktop)
    drag(desktop, by_px, button, modifiers)
    end = seen(desktop)
    assert moved(begin, end, frame) @ way > 0.99
    assert (end.yaw, end.pitch, end.zoom) == (begin.yaw, begin.pitch, begin.zoom)


def test_the_picture_stays_in_its_place_whatever_the_page_says_of_it(phone):
    """It moved under the fingers when the line above it grew by the words of what was loaded."""
    places = phone.run("""
      const { loop } = await viewer, canvas = document.querySelector("#canvas");
      const places = [canvas.getBoundingClientRect().y];
      for (const id of ["status", "report", "server"]) {
        const line = document.querySelector(`#${id}`), before = [line.hidden, line.textContent];
        Object.assign(line, { hidden: false, textContent: "many words ".repeat(40) });
        places.push(canvas.getBoundingClientRect().y);
        [line.hidden, line.textContent] = before;
      }
      loop.change();
      return places;
    """)
    assert len(set(places)) == 1


def test_two_fingers_apart_zoom_by_how_far_they_move_apart(phone):
    begin = seen(phone)
    touch(phone, "touchStart", (150, 100), (200, 100))
    touch(phone, "touchMove", (125, 100), (225, 100))
    touch(phone, "touchEnd")
    end = seen(phone)
    assert end.zoom == pytest.approx(2 * begin.zoom, rel=1e-3)
    assert (end.yaw, end.pitch) == (begin.yaw, begin.pitch)


def test_two_fingers_together_slide_with_the_hand(phone):
    begin, frame = seen(phone), axes(phone)
    touch(phone, "touchStart", (150, 100), (200, 100))
    touch(phone, "touchMove", (150, 130), (200, 130))
    touch(phone, "touchEnd")
    end = seen(phone)
    assert moved(begin, end, frame) @ (0, -1, 0) > 0.99
    assert end.zoom == pytest.approx(begin.zoom, rel=1e-3)


def test_the_finger_that_stays_turns_after_the_other_is_lifted(phone):
    touch(phone, "touchStart", (150, 100), (200, 100))
    touch(phone, "touchEnd", (200, 100), first=1)
    begin = seen(phone)
    touch(phone, "touchMove", (165, 100))
    touch(phone, "touchEnd")
    end = seen(phone)
    assert end.yaw != begin.yaw
    assert end.zoom == begin.zoom


WAYS = {
    "a": (-1, 0, 0),
    "d": (1, 0, 0),
    "w": (0, 0, 1),
    "s": (0, 0, -1),
    "q": (0, 1, 0),
    "e": (0, -1, 0),
}
STILL = """
  const { navigation, loop, renderer } = await viewer, before = navigation.toText();
  const { draw } = renderer;
  let chances = 0;  // to move: one before each drawing, and one in each frame without any
  renderer.draw = (picture) => { chances++; draw(picture); };
  while (chances < 4 && before === navigation.toText()) {
    await new Promise(requestAnimationFrame);
    if (loop.isFinished()) chances++;
  }
  renderer.draw = draw;
  return before === navigation.toText();
"""
MOVES = """
  const { navigation } = await viewer, before = navigation.toText();
  await until(() => before !== navigation.toText());
"""


@pytest.mark.parametrize(("name", "way"), WAYS.items())
def test_a_held_key_walks_its_way_until_it_is_released(desktop, name, way):
    begin, frame = seen(desktop), axes(desktop)
    key(desktop, name, "keyDown")
    desktop.run(MOVES)
    key(desktop, name, "keyUp")
    assert desktop.run(STILL)
    assert moved(begin, seen(desktop), frame) @ way > 0.9


@pytest.mark.parametrize(("name", "axis", "sign"), [
    ("ArrowLeft", 0, -1), ("ArrowRight", 0, 1), ("ArrowUp", 1, -1), ("ArrowDown", 1, 1),
])  # fmt: skip
def test_a_held_arrow_turns_to_where_it_points_until_it_is_released(desktop, name, axis, sign):
    frame = axes(desktop)
    key(desktop, name, "keyDown")
    desktop.run(MOVES)
    key(desktop, name, "keyUp")
    assert desktop.run(STILL)
    assert sign * axes(desktop)[:, 2] @ frame[:, axis] > 0


def test_keys_of_another_element_or_of_the_browser_do_not_move_the_view(desktop):
    desktop.run("document.querySelector('#share').focus();")
    key(desktop, "w", "keyDown")
    assert desktop.run(STILL)
    key(desktop, "w", "keyUp")
    desktop.run("document.querySelector('#canvas').focus();")
    desktop.command("Input.dispatchKeyEvent", type="keyDown", key="w", code="KeyW", modifiers=2)
    assert desktop.run(STILL)


def test_a_key_that_is_held_while_the_focus_leaves_does_not_go_on(desktop):
    key(desktop, "w", "keyDown")
    desktop.run(MOVES)
    desktop.run("document.querySelector('#share').focus();")
    assert desktop.run(STILL)
    key(desktop, "w", "keyUp")


def test_space_plays_and_pauses_and_a_drag_pauses_as_well(desktop):
    press(desktop, " ")
    desktop.run("const { chosen } = await viewer; await until(() => chosen.frame > 0);")
    press(desktop, " ")
    assert desktop.run(STILL)
    press(desktop, " ")
    desktop.run(MOVES)
    drag(desktop, (10, 0))
    assert desktop.run(STILL)


def test_home_returns_to_where_the_page_began(desktop):
    begin = seen(desktop)
    drag(desktop, (40, 20))
    press(desktop, "+")
    press(desktop, "Home")
    end = seen(desktop)
    np.testing.assert_allclose(end.center, begin.center, atol=1e-6)
    assert end[1:] == pytest.approx(begin[1:], abs=1e-6)


def test_digits_choose_paintings_and_x_splits(desktop):
    shown = "const { chosen } = await viewer; return [chosen.a, chosen.split];"
    press(desktop, "3")
    press(desktop, "x")
    assert desktop.run(shown) == [2, 0.5]
    press(desktop, "9")  # there are three
    press(desktop, "2")
    press(desktop, "x")
    assert desktop.run(shown) == [1, -1]


def test_k_adds_a_key_frame(desktop):
    count = "return document.querySelectorAll('#keys li').length;"
    before = desktop.run(count)
    press(desktop, "k")
    assert desktop.run(count) == before + 1


def test_p_saves_a_picture(desktop):
    desktop.run("""
      window.saved = [];
      HTMLAnchorElement.prototype.click = function () { window.saved.push(this.download); };
    """)
    press(desktop, "p")
    desktop.run("await until(() => window.saved.length);")
    assert desktop.run("return window.saved;") == ["the yard-style 1.png"]


def test_f_fills_the_screen_and_leaves_it_again(desktop):
    is_full = "return Boolean(document.fullscreenElement);"
    press(desktop, "f")
    desktop.run("await until(() => document.fullscreenElement);")
    press(desktop, "f")
    desktop.run("await until(() => !document.fullscreenElement);")
    assert not desktop.run(is_full)
