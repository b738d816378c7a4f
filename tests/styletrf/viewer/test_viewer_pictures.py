"""The page's pictures are those that the CPU renders, in a real browser.

The look of the photographs is rendered as it is baked: what that loses is the law of
`test_baking`, and depends on how the field's colors turn with the direction.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from headless import needs_chromium, with_text
from shared_browser import answer_of, opened
from viewer_pictures import CLICKS, LOOKS, PICTURES, case, psnr, rendered
from written_viewers import with_third_painting, written_small

pytestmark = needs_chromium
FEW_LOOKS = LOOKS[:4:3]


@pytest.mark.parametrize(
    ("space", "looks"), [("unbounded", LOOKS), ("ndc", FEW_LOOKS), ("box", FEW_LOOKS)]
)
def test_canvas_and_cpu_agree_for_every_look(tiny, content, tmp_path: Path, space: str, looks):
    """Views and spaces differ in the rays, looks in the colors: one view shows all looks."""
    scene = tiny(space)
    cases = [(scene.cameras[0], *look) for look in looks]
    cases += [(scene.cameras[4], *look) for look in FEW_LOOKS]
    baked = content(space)
    page = written_small(baked, tmp_path / "viewer.html")
    asked = json.dumps([case(*each) for each in cases])
    answer = answer_of(page, PICTURES.replace("CASES", asked), 1000)
    assert answer["errors"] == []
    for each, shot in zip(cases, answer["shots"], strict=True):
        expected = rendered(scene, baked, *each)
        assert psnr(np.array(shot).reshape(expected.shape), expected) >= 45, each[1:]


def test_pictures_by_fetched_texels_agree_with_the_cpu(tiny, content, tmp_path: Path):
    scene = tiny("ndc")
    page = written_small(content("ndc"), tmp_path / "viewer.html", fetched=True)
    asked = json.dumps([case(scene.cameras[0], *LOOKS[1])])
    answer = answer_of(page, PICTURES.replace("CASES", asked), 1000)
    expected = rendered(scene, content("ndc"), scene.cameras[0], *LOOKS[1])
    assert psnr(np.array(answer["shots"][0]).reshape(expected.shape), expected) >= 45


HELD_BACK = """<script>
const draws = [], requestLater = requestAnimationFrame;
requestAnimationFrame = (draw) => draws.push(draw);
</script>"""
BEFORE_AND_AFTER = """
  const unloaded = () => document.querySelectorAll("#looks .unloaded").length;
  await until(() => document.querySelector("#notice").hidden && draws.length);
  await new Promise((r) => setTimeout(r, 300));
  const before = unloaded();
  requestAnimationFrame = requestLater;
  draws.forEach(requestAnimationFrame);
  await viewer;
  return { before, after: unloaded() };
"""


def test_the_first_picture_waits_for_its_own_painting_alone(content, tmp_path: Path):
    """It waited for all paintings, and the shader was compiled after they were unpacked."""
    page = written_small(content("ndc"), tmp_path / "viewer.html")
    with_text(page, page, "<head>", "<head>" + HELD_BACK)
    answer = answer_of(page, BEFORE_AND_AFTER, 1000)
    assert answer["errors"] == []
    assert (answer["before"], answer["after"]) == (2, 0)


def test_every_control_does_something_and_nothing_fails(content, tmp_path: Path):
    page = written_small(with_third_painting(content("ndc")), tmp_path / "viewer.html")
    answer = answer_of(page, CLICKS, 1000)
    assert answer["errors"] == []
    assert len(set(answer["sums"])) == len(answer["sums"])
    views = [answer[name] for name in ("begin", "turned", "far", "zoomed")]
    assert len(set(views)) == 4
    assert answer["end"] == answer["begin"]
    assert (answer["isSplit"], answer["saved"], answer["look"]) == (True, 1, 1)
    assert answer["over"] == 0
    assert "4 looks" in answer["status"]


FITS = """
  const { loop } = await viewer;
  await until(() => loop.isSettled());
  document.querySelector("#halve").click();
  await until(() => loop.isSettled());
  return { over: overflow(), isSplit: !document.querySelector("#split").hidden };
"""


def test_the_controls_fit_on_a_phone(content, tmp_path: Path):
    page = written_small(with_third_painting(content("ndc")), tmp_path / "viewer.html")
    answer = answer_of(page, FITS, 390)
    assert (answer["errors"], answer["over"], answer["isSplit"]) == ([], 0, True)


ADDRESSES = """
  const { chosen, scene } = await viewer;
  const found = [];
  const each = ["style=style%202", "show=0", "style=nothing", "style=style+1&with=style+2"];
  for (const words of each) {
    location.hash = words;
    await new Promise((r) => setTimeout(r, 50));
    found.push([scene.looks[chosen.a].name, scene.looks[chosen.b].name]);
  }
  await until(() => location.hash.includes("view="));
  return { found, hash: location.hash };
"""


def test_an_address_names_its_paintings(content, tmp_path: Path):
    """Numbers led to another painting in a viewer of other styles, and reports to the first."""
    page = written_small(content("ndc"), tmp_path / "viewer.html")
    answer = answer_of(page, ADDRESSES, 1000)
    first, plain, unknown, both = (names[0] for names in answer["found"])
    assert (first, plain, unknown, both) == ("style 2", "Photographs", "Photographs", "style 1")
    assert answer["found"][-1][1] == "style 2"
    assert {"style=style+1", "with=style+2"} <= set(answer["hash"].removeprefix("#").split("&"))


STEERED = """
  const { navigation } = await viewer;
  const toward = (axis, by) => {  // how far the view turns towards an axis of the camera
    const before = navigation.pose();
    navigation.steer(...by);
    const after = navigation.pose(), turned = [0, 4, 8].map((i) => before[i + axis] * after[i + 2]);
    return turned.reduce((sum, value) => sum + value);
  };
  return { right: toward(0, [0.02, 0]), down: toward(1, [0, 0.02]) };
"""


@pytest.mark.parametrize("looking", ["ahead", "inward", "outward", "along"])
def test_arrow_keys_turn_to_where_they_point_in_every_scene(content, tmp_path: Path, looking: str):
    """In scenes photographed outward the right one turned to the left."""
    baked = replace(content("unbounded"), looking=looking)
    answer = answer_of(written_small(baked, tmp_path / "viewer.html"), STEERED, 1000)
    assert answer["errors"] == []
    assert answer["right"] > 1e-3
    assert answer["down"] > 1e-3


BOUNDED = """
  const { scene, navigation } = await viewer;
  const distances = [];
  for (let k = 0; k < 200; k++) {
    navigation.walk(Math.cos(k), Math.sin(2 * k), 3);
    navigation.turn(Math.sin(k), Math.cos(3 * k));
    const pose = navigation.pose(), center = [pose[3], pose[7], pose[11]];
    const away = ({ center: c }) => Math.hypot(...c.map((v, i) => v - center[i]));
    distances.push(Math.min(...scene.guides.map(away)) / scene.radius);
  }
  return { most: Math.max(...distances) };
"""


def test_the_camera_stays_near_the_photographs(content, tmp_path: Path):
    page = written_small(content("unbounded"), tmp_path / "viewer.html")
    assert answer_of(page, BOUNDED, 1000)["most"] < 1.001


WALKED = """
  const { navigation, loop } = await viewer, pad = document.querySelector("#walk");
  const pose = () => navigation.pose(), center = (p) => [p[3], p[7], p[11]];
  const along = async (key, act) => {  // right, down and ahead of the way that a button leads
    document.querySelector("#reset").click();
    const before = pose();
    await act(pad.querySelector(`[data-key=${key}]`), () => pose().join() !== before.join());
    const way = center(pose()).map((v, i) => v - center(before)[i]);
    return [0, 1, 2].map((k) => way.reduce((sum, v, i) => sum + v * before[4 * i + k], 0));
  };
  const pointer = (button, kind) => button.dispatchEvent(new PointerEvent(kind, { bubbles: true }));
  const hold = async (button, hasMoved) => {
    pointer(button, "pointerdown");
    await until(hasMoved);
    pointer(button, "pointerup");
  };
  const click = async (button, hasMoved) => { button.click(); await until(hasMoved); };
  const ways = {};
  for (const key of "adqews") ways[key] = [await along(key, hold), await along(key, click)];
  await until(() => loop.isSettled());
  const rest = navigation.toText();
  await new Promise((r) => setTimeout(r, 200));
  return { ways, isStill: rest === navigation.toText(), display: getComputedStyle(pad).display,
           over: overflow() };
"""


def test_on_a_touch_screen_buttons_walk_where_they_point_until_released(content, tmp_path: Path):
    answer = answer_of(written_small(content("box"), tmp_path / "viewer.html"), WALKED, 390)
    assert answer["errors"] == []
    assert (answer["display"], answer["isStill"], answer["over"]) == ("flex", True, 0)
    axes = {"a": (0, -1), "d": (0, 1), "e": (1, -1), "q": (1, 1), "s": (2, -1), "w": (2, 1)}
    for key, (axis, sign) in axes.items():
        for way in answer["ways"][key]:
            assert way[axis] * sign > 0.9 * np.linalg.norm(way) > 0, key


WHERE_AHEAD_IS = """
  const { loop } = await viewer, button = document.querySelector("#walk [data-key=w]");
  await until(() => loop.isSettled());
  const { x, y, width, height } = button.getBoundingClientRect();
  return { x: x + width / 2, y: y + height / 2 };
"""
WALKS_TO_THE_BOUND = """
  const { navigation, scene } = await viewer;
  const at = () => navigation.pose().filter((_, k) => k % 4 === 3);
  const away = (center) => Math.hypot(...center.map((v, i) => v - at()[i])) / scene.radius;
  const begin = at();
  await until(() => away(begin) > 0.1);
  for (let last = begin; away(last) > 0.02;) {
    last = at();
    await new Promise((r) => setTimeout(r, 300));
  }
  return Math.min(...scene.guides.map(({ center }) => away(center)));
"""
STAYS = """
  const { navigation } = await viewer, before = navigation.toText();
  await new Promise((r) => setTimeout(r, 300));
  return before === navigation.toText();
"""


def test_a_finger_that_holds_a_button_walks_as_far_as_photographs_support(content, tmp_path: Path):
    page = written_small(content("box"), tmp_path / "viewer.html")
    with opened(page.as_uri(), 390) as phone:
        finger = phone.run(WHERE_AHEAD_IS)
        phone.command("Input.dispatchTouchEvent", type="touchStart", touchPoints=[finger])
        assert 0.99 < phone.run(WALKS_TO_THE_BOUND) < 1.001
        phone.command("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        assert phone.run(STAYS)
        assert phone.errors == []


def test_where_a_pointer_hovers_the_buttons_to_walk_are_hidden(content, tmp_path: Path):
    page = written_small(content("box"), tmp_path / "viewer.html")
    shown = "return { display: getComputedStyle(document.querySelector('#walk')).display };"
    assert answer_of(page, shown, 1000)["display"] == "none"
