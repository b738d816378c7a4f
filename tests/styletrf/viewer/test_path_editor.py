"""Paths drawn in the page are read by `--path`, and the page previews what is rendered."""

import json
import shlex
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from headless import needs_chromium, with_text
from shared_browser import answer_of
from written_viewers import written_small

from styletrf.geometry.lenses import focal_of
from styletrf.geometry.rotations import matrices_of
from styletrf.geometry.typical_view import typical_view
from styletrf.trajectory.camera_path import frames_along, timed
from styletrf.trajectory.path_files import placed_key_frames, read_path
from styletrf.trajectory.trajectory_config import TrajectoryConfig
from styletrf.viewer.camera_bounds import camera_bounds

pytestmark = needs_chromium
RATE, SECONDS = 24.0, 1.5
DRAWN = """
  const { navigation, editor } = await viewer;
  const find = (what) => document.querySelector(what), saved = [];
  const set = (id, values) => {
    Object.assign(find(id), values);
    find(id).dispatchEvent(new Event("input"));
  };
  HTMLAnchorElement.prototype.click = function () { saved.push([this.download, this.href]); };
  const seen = () => navigation.seenFrom(navigation.toText());
  const views = [];
  for (let k = 0; k < KEYS; k++) {
    views.push(seen());
    find("#addKey").click();
    if (k !== 1) {  // where it only zooms
      navigation.walk(0.3, 0.1 * k, 0.5);
      navigation.turn(0.2 - 0.15 * k, 0.1);
    }
    navigation.zoomBy(1.2);
  }
  set("#closed", { checked: CLOSED });
  set("#seconds", { value: SECONDS });
  set("#easing", { value: 0.4 });
  find("#download").click();
  const file = await (await fetch(saved[0][1])).text();
  return { views, file, name: saved[0][0], frames: editor.frames(),
           command: find("#command").textContent };
"""


def drawn(baked, tmp_path: Path, keys: int, *, closed: bool) -> dict:
    named = replace(baked, scene="Ann's yard; 2 $(exit)")
    page = written_small(named, tmp_path / "viewer.html")
    with_text(page, page, "img-src", "connect-src blob:; img-src")
    words = {"KEYS": keys, "CLOSED": closed, "SECONDS": SECONDS}
    probe = DRAWN
    for word, value in words.items():
        probe = probe.replace(word, json.dumps(value))
    return answer_of(page, probe, 1000)


@pytest.mark.parametrize(
    ("away", "keys", "closed"),
    [(0.0, 4, False), (0.0, 3, True), (5e6, 1, False)],
    ids=["open", "closed", "georeferenced"],
)
def test_a_drawn_path_is_read_and_rendered_as_it_is_shown(
    tiny, content, tmp_path: Path, away: float, keys: int, closed: bool
):
    """Positions of georeferenced poses were rounded to a centimeter."""
    scene, moved_away = tiny("ndc"), np.eye(4)
    moved_away[:3, 3] = away
    normalized_from_world = scene.model.normalized_from_world @ np.linalg.inv(moved_away)
    model = replace(scene.model, normalized_from_world=normalized_from_world)
    baked = replace(content("ndc"), world_from_normalized=np.linalg.inv(normalized_from_world))
    answer = drawn(baked, tmp_path, keys, closed=closed)
    assert answer["errors"] == []
    command = ["--path", answer["name"], "--seconds", str(SECONDS)]
    assert shlex.split(answer["command"]) == command
    file = tmp_path / "path.json"
    file.write_text(answer["file"])
    read = read_path(file)
    assert (len(read.frames), read.closed, read.easing) == (keys, closed, 0.4)
    placed = placed_key_frames(read, scene.cameras, model, are_given=False)
    usual = typical_view(scene.cameras)
    stays = TrajectoryConfig(seconds=SECONDS)
    frames = frames_along(timed(read, placed), usual, stays, RATE)
    assert len(frames) == len(answer["frames"])
    for expected, shown in zip(frames, answer["frames"], strict=True):
        pose = np.reshape(shown["pose"], (3, 4))
        np.testing.assert_allclose(pose, expected.world_from_camera, atol=2e-4)
        zoom = focal_of(expected) / focal_of(usual)
        assert shown["zoom"] == pytest.approx(zoom, rel=1e-4)
    rotations = matrices_of(placed.quaternions)
    for k, view in enumerate(answer["views"]):
        pose = np.reshape(view["pose"], (3, 4))
        np.testing.assert_allclose(placed.centers[k], pose[:, 3], atol=1e-5)
        np.testing.assert_allclose(rotations[k], pose[:, :3], atol=1e-5)
        assert placed.focals[k] == pytest.approx(view["zoom"] * focal_of(usual), rel=1e-5)


CHANGED = """
  const { navigation, editor } = await viewer, find = (what) => document.querySelector(what);
  const press = (label) => find(`#keys [aria-label="${label}"]`).click();
  const texts = () => editor.toText().split(";");
  for (let k = 0; k < 3; k++) { find("#addKey").click(); navigation.walk(0.4, 0, 0); }
  const begun = texts();
  press("Move key frame 1 later");
  const moved = texts();
  press("Move key frame 3 earlier");
  const back = texts();
  press("Delete key frame 2");
  const left = texts();
  press("Go to key frame 2");
  const there = navigation.toText();
  await until(() => location.hash.includes("path="));
  const hash = location.hash;
  press("Delete key frame 1");
  press("Delete key frame 1");
  const isEmpty = find("#preview").disabled && find("#download").disabled;
  await until(() => !location.hash.includes("path="));
  location.hash = hash;
  await until(() => editor.toText());
  const again = texts();
  find("#preview").click();
  const { chosen } = await viewer;
  await until(() => chosen.frame > 0 && chosen.clip);
  find("#play").click();
  const plays = chosen.isPlaying && !chosen.clip;
  return { begun, moved, back, left, there, isEmpty, again, plays, over: overflow(),
           cards: document.querySelectorAll("#keys li").length };
"""


@pytest.mark.parametrize("width", [1000, 390])
def test_key_frames_are_ordered_deleted_and_kept_in_the_address(content, tmp_path, width):
    page = written_small(content("ndc"), tmp_path / "viewer.html")
    answer = answer_of(page, CHANGED, width)
    assert answer["errors"] == []
    a, b, c = answer["begun"]
    assert len({a, b, c}) == 3
    assert answer["moved"] == [b, a, c]
    assert answer["back"] == [b, c, a]
    assert answer["left"] == answer["again"] == [b, a]
    assert answer["there"] == a
    assert answer["isEmpty"]
    assert answer["plays"]
    assert (answer["cards"], answer["over"]) == (2, 0)


ADDED = """
  const { renderer, loop } = await viewer, { draw, fence, present } = renderer, drawn = [];
  let isAdded = false;
  renderer.draw = (picture) => { drawn.push(picture.width); draw(picture); };
  renderer.present = () => { drawn.push("shown"); present(); };
  renderer.fence = async () => {
    if (!isAdded) document.querySelector("#addKey").click();
    isAdded = true;
    await fence();
  };
  loop.change();
  await until(() => isAdded && loop.isSettled());
  return { drawn, thumbnail: document.querySelector("#keys canvas").width };
"""


def test_a_key_frame_added_while_a_picture_is_drawn_does_not_replace_it(content, tmp_path):
    """Its thumbnail was shown, enlarged, until the next picture."""
    answer = answer_of(written_small(content("ndc"), tmp_path / "viewer.html"), ADDED, 1000)
    assert answer["errors"] == []
    drawn = answer["drawn"]
    assert answer["thumbnail"] in drawn
    shown = [before for before, now in pairwise(drawn) if now == "shown"]
    assert shown
    assert answer["thumbnail"] not in shown


FOLLOWED = """
  const { navigation, scene } = await viewer, focal = (seen) => navigation.view(1, 1, seen).fx;
  navigation.zoomBy(ZOOM);
  const focals = scene.path.map((_, k) => {
    navigation.follow(k);
    return [focal(), focal(navigation.seenFrom(navigation.toText()))];
  });
  const again = scene.path.map((_, k) => {
    navigation.fromText(navigation.toText());
    navigation.follow(k);
    return focal();
  });
  return { focals, again };
"""


def test_play_shows_each_frame_through_its_own_lens_zoomed_as_the_user_did(content, tmp_path):
    """All frames had the lens of the first, and after a reload the zoom of the view twice."""
    baked, zoom = content("ndc"), 1.5
    lenses = zip(baked.path, (1.0, 2.0, 0.5, 6.0, 0.25), strict=True)
    path = [replace(camera, fx=k * camera.fx, fy=k * camera.fy) for camera, k in lenses]
    page = written_small(replace(baked, path=path), tmp_path / "viewer.html")
    answer = answer_of(page, FOLLOWED.replace("ZOOM", str(zoom)), 1000)
    assert answer["errors"] == []
    for camera, (shown, of_address) in zip(path, answer["focals"], strict=True):
        assert shown == pytest.approx(zoom * camera.fx / camera.width)
        assert of_address == pytest.approx(shown, rel=1e-5)
    assert answer["again"] == pytest.approx([camera.fx / camera.width for camera in path])


SHOWN = """
  const { navigation, scene } = await viewer, { width, height } = scene.path[0];
  const shown = (...seen) => navigation.view(width, height, ...seen);
  return { frames: scene.path.map((_, k) => {
    navigation.follow(k);
    const followed = shown(), text = navigation.toText();
    navigation.fromText(text);
    return [followed, shown(), shown(navigation.seenFrom(text))];
  }) };
"""


def test_play_and_its_links_show_the_pose_and_the_lens_of_each_frame(content, tmp_path):
    """Views along the vertical were tilted, and all had the first one's principal point."""
    baked, path = content("ndc"), []
    for k, tilt in enumerate((0.0, 0.02, -0.05, 0.6, np.pi)):
        pose = np.column_stack([looking_down(k, tilt), [0.1 * k, 0, 0]])
        path.append(replace(baked.path[k], fy=60.0 + 5 * k, cx=20.0 + k, world_from_camera=pose))
    bounds = replace(camera_bounds(path, path), down=(0.0, 1.0, 0.0))  # which the first looks along
    page = written_small(replace(baked, path=path, bounds=bounds), tmp_path / "viewer.html")
    answer = answer_of(page, SHOWN, 1000)
    assert answer["errors"] == []
    for camera, shown in zip(path, answer["frames"], strict=True):
        for seen in shown:
            pose = np.reshape(seen["pose"], (3, 4))
            np.testing.assert_allclose(pose, camera.world_from_camera, atol=1e-5)
            lens = [seen[name] for name in ("fx", "fy", "cx", "cy")]
            assert lens == pytest.approx([camera.fx, camera.fy, camera.cx, camera.cy], rel=1e-4)


def looking_down(heading_rad: float, tilt_rad: float) -> np.ndarray:
    """Returns the axes of a camera that looks along y, tilted about x and then turned about y."""
    turned, tilted = np.zeros(4), np.zeros(4)
    turned[[0, 2]] = np.cos(heading_rad / 2), np.sin(heading_rad / 2)
    tilted[[0, 1]] = np.cos(tilt_rad / 2), np.sin(tilt_rad / 2)
    along_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return matrices_of(turned[None])[0] @ matrices_of(tilted[None])[0] @ along_y
