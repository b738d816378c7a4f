"""In a real browser: a style comes while the page is open, and a drawn path is saved as seen."""

import numpy as np
import pytest
from headless import needs_chromium
from shared_browser import opened

from styletrf.geometry.lenses import focal_of
from styletrf.geometry.rotations import matrices_of
from styletrf.trajectory.path_files import placed_key_frames, read_path

pytestmark = needs_chromium
NAMES = "return [...document.querySelectorAll('#looks span')].map((each) => each.textContent);"
OVERFLOW = """
  const { scrollWidth, clientWidth } = document.documentElement;
  return scrollWidth - clientWidth;
"""
DRAWN = """
  const { navigation } = await viewer, find = (what) => document.querySelector(what), views = [];
  for (let k = 0; k < 2; k++) {
    views.push(navigation.seenFrom(navigation.toText()));
    find("#addKey").click();
    navigation.walk(0.2, 0.1, 0.4);
    navigation.turn(0.1, 0.05);
  }
  find("#seconds").value = 3.5;
  find("#savePath").click();
  await until(() => !find("#saved").hidden);
  return { views, text: find("#savedText").textContent, command: find("#command").textContent };
"""


@pytest.mark.parametrize("width", [1000, 390])
def test_a_style_comes_and_a_path_goes(served, width: int):
    with opened(served.server.address, width) as page:
        page.run("await viewer; return 1;")
        assert page.run(NAMES) == ["Photographs"]
        page.run("window.stays = true;")
        served.live.add(*served.more())
        page.run("await until(() => document.querySelectorAll('#looks label').length === 2);")
        assert page.run(NAMES) == ["Photographs", "p"]
        page.run("const { choose } = await viewer; choose(1);")
        drawn = page.run(DRAWN)
        assert page.run("return window.stays;")
        assert page.run(OVERFLOW) == 0
        assert page.errors == []
    assert str(served.file) in drawn["text"]
    assert drawn["command"].endswith(f"--style p --path {served.file} --seconds 3.5")
    scene, keys = served.scene, read_path(served.file)
    placed = placed_key_frames(keys, scene.photographed, scene.model, are_given=False)
    lens = focal_of(scene.path[0])  # of the page, which counts zoom from it
    for k, (view, rotation) in enumerate(
        zip(drawn["views"], matrices_of(placed.quaternions), strict=True)
    ):
        pose = np.reshape(view["pose"], (3, 4))
        np.testing.assert_allclose(placed.centers[k], pose[:, 3], atol=1e-5)
        np.testing.assert_allclose(rotation, pose[:, :3], atol=1e-5)
        assert placed.focals[k] == pytest.approx(view["zoom"] * lens, rel=1e-5)


def test_a_page_that_is_loaded_again_has_all_styles(served):
    served.live.add(*served.more())
    with opened(served.server.address) as page:
        page.run("await viewer; return 1;")
        assert page.run(NAMES) == ["Photographs", "p"]
        assert page.errors == []


def test_without_the_token_a_browser_shows_no_page(served):
    with opened(served.server.address.rpartition("/a-")[0] + "/") as page:
        assert not page.run("return Boolean(document.querySelector('canvas'));")


def test_a_server_that_stops_leaves_the_page_usable(served):
    with opened(served.server.address) as page:
        page.run("await viewer; return 1;")
        served.server.shutdown()
        served.server.server_close()
        notice = "!document.querySelector('#server').hidden"
        page.run(f"await until(() => {notice});")
        page.run("document.querySelector('#addKey').click();")
        assert page.run("return document.querySelectorAll('#keys li').length;") == 1
