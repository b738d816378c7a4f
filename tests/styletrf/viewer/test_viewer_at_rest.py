"""What the page shows of a view that stands still, and how it comes there."""

import base64
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import headless
import numpy as np
import pytest
from headless import OpenPage, needs_chromium
from shared_browser import opened
from viewer_pictures import psnr, rendered
from written_viewers import written_small

from styletrf.geometry.cameras import Camera

pytestmark = needs_chromium
PAINTING = 1


@pytest.fixture(scope="module")
def page_file(content, tmp_path_factory) -> Path:
    """Returns a viewer of small pictures."""
    return written_small(content("box"), tmp_path_factory.mktemp("viewer") / "viewer.html", 48)


@pytest.fixture(scope="module")
def page(page_file: Path) -> Iterator[OpenPage]:
    with headless.opened(page_file.as_uri()) as shown:
        shown.run("await viewer;")
        yield shown
        assert shown.errors == []


AT_REST = """
  const { loop, renderer, navigation, picture } = await viewer;
  const { width, height } = document.querySelector("canvas");
  const status = () => document.querySelector("#status").textContent;
  for (let last = ""; !/mean of/.test(last) || last !== status() || !loop.isFinished();) {
    last = status();
    if (loop.isFinished() && !/mean of/.test(last)) loop.change();  // it was slow for a moment
    await new Promise((r) => setTimeout(r, 300));
  }
  const count = +/mean of (\\d+)/.exec(status())[1];
  const view = { ...navigation.view(width, height), width, height };
"""
MEAN = (
    AT_REST
    + """
  const colors = renderer.read(), { a, b, shareB, split } = picture(width, height);
  const moved = (offset) => {
    renderer.draw({ view, a, b, shareB, split, width, height, offset });
    return renderer.read();
  };
  const pictures = OFFSETS.slice(0, count).map(moved), far = moved([3, -2]);
  loop.change();
  return { view, colors, pictures, far };
"""
)


def halton(k: int, base: int) -> float:
    value, fraction = 0.0, 1 / base
    while k:
        value, k, fraction = value + fraction * (k % base), k // base, fraction / base
    return value


def test_a_view_at_rest_is_the_mean_of_pictures_moved_within_a_pixel(page, tiny, content):
    offsets = [(0, 0), *((halton(k, 2) - 0.5, halton(k, 3) - 0.5) for k in range(1, 16))]
    shown = page.run(MEAN.replace("OFFSETS", json.dumps(offsets)))
    pictures, colors = np.array(shown["pictures"]), np.array(shown["colors"])
    assert 4 <= len(pictures) <= 16  # fewer on a slow machine
    away = [np.square(colors - each).mean() for each in (pictures.mean(axis=0), pictures[0])]
    assert away[0] < away[1] / 8  # sums are of 16 bits
    camera = camera_of(shown["view"], tiny("box").cameras[0])
    moved = replace(camera, cx=camera.cx - 3, cy=camera.cy + 2)
    expected = rendered(tiny("box"), content("box"), moved, PAINTING, 0, 0, -1)
    assert psnr(np.reshape(shown["far"], expected.shape), expected) >= 45


def camera_of(view: dict, example: Camera) -> Camera:
    lens = {name: float(view[name]) for name in ("fx", "fy", "cx", "cy")}
    size = {name: view[name] for name in ("width", "height")}
    pose = np.reshape(view["pose"], (3, 4))
    return replace(example, world_from_camera=pose, **lens, **size)


SAVES = """
  const blobs = [], remembered = URL.createObjectURL;
  URL.createObjectURL = (blob) => { blobs.push(blob); return remembered(blob); };
  const saved = async () => {
    await until(() => blobs.length);
    URL.createObjectURL = remembered;
    const bytes = new Uint8Array(await blobs[0].arrayBuffer());
    return btoa(String.fromCharCode(...bytes));
  };
"""
SAVED = (
    AT_REST
    + SAVES
    + """
  const colors = renderer.read(), { draw } = renderer;
  let drawn = 0;
  renderer.draw = (picture) => { drawn++; draw(picture); };
  document.querySelector("#save").click();
  const png = await saved();
  renderer.draw = draw;
  return { view, colors, drawn, png };
"""
)


def test_a_picture_at_rest_is_saved_as_it_is_shown(page):
    shown = page.run(SAVED)
    data = np.frombuffer(base64.b64decode(shown["png"]), np.uint8)
    saved = cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1] / 255
    assert saved.shape == (shown["view"]["height"], shown["view"]["width"], 3)
    assert np.abs(saved - np.reshape(shown["colors"], saved.shape)).max() <= 1 / 255
    assert shown["drawn"] == 0  # nothing but the mean


SLOW = """
  const { fence } = renderer;
  renderer.fence = async () => { await fence(); await new Promise((r) => setTimeout(r, 60)); };
"""
SAVED_MEANWHILE = (
    SAVES
    + """
  const { draw, present } = renderer;
  let done = [], isAsked = false;
  renderer.draw = (picture) => {
    draw(picture);
    const isPart = picture.end < picture.height;
    done.push(picture.end === undefined ? "plain" : isPart ? "part" : "whole");
    if (isAsked || picture.count < 2 || picture.end === picture.height) return;
    [isAsked, done] = [true, ["part"]];
    document.querySelector("#save").click();
  };
  renderer.present = () => { done.push("shown"); present(); };
  const png = saved();
  while (!isAsked) {  // a card that was slow for a moment draws a single picture
    loop.change();
    await until(() => isAsked || loop.isFinished());
  }
  await png;
  Object.assign(renderer, { draw, present });
  return done;
"""
)


def test_a_picture_is_saved_when_it_is_whole(content, tmp_path):
    """While a picture was drawn in parts, it was saved with some parts newer than others."""
    page = written_small(content("ndc"), tmp_path / "viewer.html", 48)
    with opened(page.as_uri()) as shown:
        done = shown.run("const { renderer, loop } = await viewer;" + SLOW + SAVED_MEANWHILE)
        assert shown.errors == []
    assert done[0] == "part"
    assert "plain" not in done
    assert done[done.index("shown") - 1] == "whole"


SAVED_AND_MOVED = (
    SAVES
    + """
  const { draw } = renderer, drawn = [], find = (what) => document.querySelector(what);
  let clicked = null;
  renderer.draw = (picture) => {
    draw(picture);
    if (clicked) drawn.push(picture);
    if (clicked || picture.count < 2 || picture.end === picture.height) return;
    clicked = picture.view.pose.join();
    find("#save").click();
    navigation.turn(0.2, 0);
    loop.change();
  };
  const done = saved();
  while (!clicked) {  // a card that was slow for a moment draws a single picture
    loop.change();
    await until(() => clicked || loop.isFinished());
  }
  await done;
  renderer.draw = draw;
  const { width } = find("#canvas");
  const whole = drawn.filter((picture) => picture.end === undefined && picture.width === width);
  return whole.map(({ view }) => view.pose.join() === clicked);
"""
)


def test_a_picture_of_a_view_that_moves_on_is_saved_as_it_was_at_the_click(content, tmp_path):
    """It was saved when the view stood still again, which then was another one."""
    page = written_small(content("ndc"), tmp_path / "viewer.html", 48)
    with opened(page.as_uri()) as shown:
        script = "const { renderer, loop, navigation } = await viewer;" + SLOW + SAVED_AND_MOVED
        assert shown.run(script) == [True]
        assert shown.errors == []


SLOWER = """
  const { renderer, loop } = await viewer, { draw, fence } = renderer;
  let isSlow = false, last = null;
  renderer.fence = async () => {
    await fence();
    await new Promise((r) => setTimeout(r, isSlow ? 1000 : 60));
  };
  renderer.draw = (picture) => {
    draw(picture);
    last = picture;
    isSlow ||= picture.count === 2 && picture.end < picture.height;
  };
  while (!isSlow) {  // a card that was slow for a moment draws a single picture
    loop.change();
    await until(() => isSlow || loop.isFinished());
  }
  await until(() => loop.isFinished());
  return last.end === last.height;
"""


def test_a_picture_that_was_begun_is_drawn_to_its_end_on_a_card_that_becomes_slow(page_file):
    """It ended at a part, so a view at rest stayed half a mean, and half one picture more."""
    with opened(page_file.as_uri()) as shown:
        assert shown.run(SLOWER)
        assert shown.errors == []


SWITCHED = """
  const { loop, renderer, choose, chosen } = await viewer, drawn = [];
  await until(() => loop.isSettled());
  const { draw, present } = renderer;
  renderer.draw = (picture) => { drawn.push(picture); return draw(picture); };
  renderer.present = () => { drawn.push("shown"); return present(); };
  choose(chosen.a === 1 ? 2 : 1);
  await until(() => drawn.includes("shown"));
  Object.assign(renderer, { draw, present });
  const first = drawn.slice(0, drawn.indexOf("shown"));
  return { chosen: chosen.a, looks: first.map(({ a }) => a),
           isWhole: first.length === 1 && first[0].end === first[0].height };
"""


def test_the_next_picture_after_a_switch_is_the_whole_other_painting(page):
    for _ in range(2):
        answer = page.run(SWITCHED)
        assert answer["looks"] == [answer["chosen"]]
        assert answer["isWhole"]


PLACED = """
  const { navigation, chosen, refresh } = await viewer;
  navigation.walk(0.3, 0.1, 0.2);
  navigation.turn(0.2, -0.1);
  navigation.zoomBy(1.7);
  Object.assign(chosen, { a: 2, b: 1, share: 0.25, split: 0.75 });
  refresh();
  await until(() => location.hash.includes("split"));
  return { view: navigation.toText(), href: location.href };
"""
FOUND = """
  const { navigation, chosen } = await viewer;
  const { a, b, share, split } = chosen;
  return { view: navigation.toText(), shown: [a, b, share, split] };
"""


def test_a_link_shows_the_same_view_and_looks(page_file):
    with opened(page_file.as_uri()) as first:
        placed = first.run(PLACED)
    with opened(placed["href"]) as second:
        found = second.run(FOUND)
        assert second.errors == []
    assert found["shown"] == [2, 1, 0.25, 0.75]
    view = [np.array(text.split(","), float) for text in (placed["view"], found["view"])]
    np.testing.assert_allclose(view[0], view[1], atol=2e-6)


def test_a_link_beyond_what_photographs_support_leads_to_where_they_do(page_file):
    far = f"{page_file.as_uri()}#view=1e6,0,0,3,0.1,0,50"
    nearest = """
      const { scene, navigation } = await viewer, at = navigation.pose();
      const away = ({ center }) => Math.hypot(...center.map((v, i) => v - at[4 * i + 3]));
      const zoom = navigation.toText().split(",").at(-1);
      return [Math.min(...scene.guides.map(away)) / scene.radius, zoom];
    """
    with opened(far) as shown:
        away, zoom = shown.run(nearest)
        assert shown.errors == []
    assert away < 1.001
    assert float(zoom) == 8


MOVED = """
  const { loop, renderer } = await viewer, { draw } = renderer;
  const canvas = document.querySelector("canvas");
  FENCE
  let scale = 0, pictures = 0;
  renderer.draw = (picture) => { scale = picture.width / canvas.width; pictures++; draw(picture); };
  for (const first = pictures; pictures < first + 12;) {
    loop.change();
    await new Promise(requestAnimationFrame);
  }
  const moving = scale;
  await until(() => loop.isSettled());
  renderer.draw = draw;
  return { moving, still: scale };
"""
QUICK = "renderer.fence = async () => {};"


@pytest.mark.parametrize(("fence", "is_coarse"), [(SLOW, True), (QUICK, False)])
def test_a_moving_picture_is_as_coarse_as_the_graphics_card_is_slow(
    content, tmp_path, fence, is_coarse
):
    page = written_small(content("ndc"), tmp_path / "viewer.html", 160)
    with opened(page.as_uri()) as shown:
        widths = shown.run(MOVED.replace("FENCE", fence))
        assert shown.errors == []
    assert (widths["moving"] < 0.5) == is_coarse
    assert widths["still"] == 1
