"""The page's pictures are those that the CPU renders, in a real browser.

The look of the photographs is rendered as it is baked: what that loses is the law of
`test_baking`, and depends on how the field's colors turn with the direction.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from headless import answer_of, needs_chromium
from test_viewer_page import written

from styletrf.field.kernels import kernels_for
from styletrf.field.rendering import render_view
from styletrf.field.view_rays import ViewRays
from styletrf.psnr import bounded_psnr
from styletrf.stylization.mixed_appearance import MixedAppearance
from styletrf.viewer.viewer_content import RENDER

pytestmark = needs_chromium
CPU = torch.device("cpu")
LOOKS = [  # a, b, share of b, split
    (0, 1, 0.0, -1),
    (1, 0, 0.0, -1),
    (2, 0, 0.0, -1),
    (1, 2, 0.5, -1),
    (1, 2, 1.0, -1),
    (1, 2, 0.3, 0.5),
]
PICTURES = """
  const { scene, renderer } = await viewer;
  const shot = (each) => { renderer.draw(each); return renderer.read().map((v) => +v.toFixed(4)); };
  return { shots: CASES.map(shot) };
"""


def rendered(scene, baked, camera, a: int, b: int, share_b: float, split: float) -> np.ndarray:
    """What the CPU renders: of the photographs what is baked, of styles the fields themselves."""
    fields = list(scene.fields.values())
    appearances = [baked.looks[0].appearance(), *(field.appearance for field in fields[1:])]
    rays = ViewRays([camera], scene.model.space, fields[0].step_length, CPU)

    def mixed(share: float) -> np.ndarray:
        one, other = appearances[a], appearances[b]
        appearance = {0.0: one, 1.0: other}.get(share)
        if appearance is None:
            appearance = MixedAppearance([one, other], [1 - share, share])
        kernels = kernels_for(CPU)
        return render_view(fields[0], kernels, rays, 0, camera, RENDER, appearance).color.numpy()

    if split < 0:
        return mixed(share_b)
    left = (np.arange(camera.width) + 0.5 < split * camera.width)[None, :, None]
    return np.where(left, mixed(1.0), mixed(0.0))


def case(camera, a: int, b: int, share_b: float, split: float) -> dict:
    """The same for the page."""
    lens = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    view = {"pose": camera.world_from_camera.ravel().tolist(), **lens}
    size = {"width": camera.width, "height": camera.height}
    return {"view": view, "a": a, "b": b, "shareB": share_b, "split": split, **size}


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return bounded_psnr(float(np.square(one - other).mean()))


@pytest.mark.parametrize("space", ["ndc", "box", "unbounded"])
def test_canvas_and_cpu_agree_for_every_look(tiny, content, tmp_path: Path, space: str):
    scene = tiny(space)
    cases = [(camera, *look) for camera in scene.cameras[:5] for look in LOOKS]
    baked = content(space)
    page = written(baked, tmp_path / "viewer.html")
    asked = json.dumps([case(*each) for each in cases])
    answer = answer_of(page, PICTURES.replace("CASES", asked), 800)
    assert answer["errors"] == []
    for each, shot in zip(cases, answer["shots"], strict=True):
        expected = rendered(scene, baked, *each)
        assert psnr(np.array(shot).reshape(expected.shape), expected) >= 45, each[1:]


@pytest.mark.parametrize("fetched", [False, True])
def test_both_ways_of_interpolation_agree_with_the_cpu(tiny, content, tmp_path: Path, fetched):
    scene = tiny("ndc")
    page = written(content("ndc"), tmp_path / "viewer.html", fetched=fetched)
    asked = json.dumps([case(scene.cameras[0], *LOOKS[1])])
    answer = answer_of(page, PICTURES.replace("CASES", asked), 800)
    expected = rendered(scene, content("ndc"), scene.cameras[0], *LOOKS[1])
    assert psnr(np.array(answer["shots"][0]).reshape(expected.shape), expected) >= 45


CLICKS = """
  const { shown, navigation, loop, renderer, picture } = await viewer;
  const find = (what) => document.querySelector(what), canvas = find("canvas"), sums = [];
  const pointer = (kind, x, y) => canvas.dispatchEvent(
    new PointerEvent(kind, { pointerId: 1, clientX: x, clientY: y, buttons: 1 }));
  const drag = (x, y) => {
    pointer("pointerdown", 100, 100);
    pointer("pointermove", 100 + x, 100 + y);
    pointer("pointerup", 100 + x, 100 + y);
  };
  const press = (key) => canvas.dispatchEvent(new KeyboardEvent("keydown", { key }));
  const look = async () => {
    await until(() => loop.isSettled());
    renderer.draw({ ...picture(32, 24), width: 32, height: 24 });
    sums.push(renderer.read().reduce((a, b) => a + b));
    loop.change();
  };
  await until(() => loop.isSettled());
  const begin = navigation.toText();
  drag(5, 3);
  const turned = navigation.toText();
  drag(5000, 3000);
  const far = navigation.toText();
  for (const radio of document.querySelectorAll("#looks input")) { radio.click(); await look(); }
  find("#share").value = 0.5;
  find("#share").dispatchEvent(new Event("input"));
  await look();
  find("#halve").click();
  await look();
  const isSplit = !find("#split").hidden;
  press("x"); press("2"); press("+");
  const zoomed = navigation.toText();
  find("#play").click();
  await until(() => shown.frame > 0);
  find("#play").click();
  let saved = 0;
  HTMLAnchorElement.prototype.click = function () {
    saved += Boolean(this.download) && this.href.startsWith("blob:");
  };
  find("#save").click();
  await until(() => saved > 0);
  find("#reset").click();
  await until(() => location.hash.includes("view=") && loop.isSettled());
  return { begin, turned, far, zoomed, sums, isSplit, saved, over: overflow(), look: shown.a,
           status: find("#status").textContent, end: navigation.toText() };
"""


@pytest.mark.parametrize("width", [1000, 390])
def test_every_control_does_something_and_nothing_fails(content, tmp_path: Path, width: int):
    page = written(content("ndc"), tmp_path / "viewer.html")
    page.write_text(page.read_text().replace('"mostPixels": 1600', '"mostPixels": 160'))
    answer = answer_of(page, CLICKS, width)
    assert answer["errors"] == []
    assert len(set(answer["sums"])) == len(answer["sums"])
    views = [answer[name] for name in ("begin", "turned", "far", "zoomed")]
    assert len(set(views)) == 4
    assert answer["end"] == answer["begin"]
    assert (answer["isSplit"], answer["saved"], answer["look"]) == (True, 1, 1)
    assert answer["over"] == 0
    assert "3 looks" in answer["status"]


ADDRESSES = """
  const { shown, scene } = await viewer;
  const found = [];
  const each = ["style=style%202", "show=0", "style=nothing", "style=style+1&with=style+2"];
  for (const words of each) {
    location.hash = words;
    await new Promise((r) => setTimeout(r, 50));
    found.push([scene.looks[shown.a].name, scene.looks[shown.b].name]);
  }
  await until(() => location.hash.includes("view="));
  return { found, hash: location.hash };
"""


def test_an_address_names_its_paintings(content, tmp_path: Path):
    """Numbers led to another painting in a viewer of other styles, and reports to the first."""
    page = written(content("ndc"), tmp_path / "viewer.html")
    answer = answer_of(page, ADDRESSES, 800)
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
    answer = answer_of(written(baked, tmp_path / "viewer.html"), STEERED, 800)
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
    page = written(content("unbounded"), tmp_path / "viewer.html")
    assert answer_of(page, BOUNDED, 800)["most"] < 1.001
