"""Paths drawn in the page are read by `--path`, and the page previews what is rendered."""

import json
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
    navigation.walk(0.3, 0.1 * k, 0.5);
    navigation.turn(0.2 - 0.15 * k, 0.1);
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


def drawn(content, tmp_path: Path, space: str, keys: int, *, closed: bool) -> dict:
    page = written_small(content(space), tmp_path / "viewer.html")
    with_text(page, page, "img-src", "connect-src blob:; img-src")
    words = {"KEYS": keys, "CLOSED": closed, "SECONDS": SECONDS}
    probe = DRAWN
    for word, value in words.items():
        probe = probe.replace(word, json.dumps(value))
    return answer_of(page, probe, 1000)


@pytest.mark.parametrize(
    ("space", "keys", "closed"),
    [("ndc", 4, False), ("ndc", 3, True), ("ndc", 1, False)],
)
def test_a_drawn_path_is_read_and_rendered_as_it_is_shown(
    tiny, content, tmp_path: Path, space: str, keys: int, closed: bool
):
    answer = drawn(content, tmp_path, space, keys, closed=closed)
    assert answer["errors"] == []
    assert answer["command"] == f"--path {answer['name']} --seconds {SECONDS}"
    file, scene = tmp_path / "path.json", tiny(space)
    file.write_text(answer["file"])
    read = read_path(file)
    assert (len(read.frames), read.closed, read.easing) == (keys, closed, 0.4)
    placed = placed_key_frames(read, scene.cameras, scene.model, are_given=False)
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
