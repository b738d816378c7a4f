"""The page in Firefox and in Safari's engine: its pictures are the CPU's, its controls work."""

import json
from pathlib import Path

import numpy as np
import pytest
from headless import Browser, answer_of
from other_browsers import firefox, needs_firefox, needs_webkit, webkit
from shared_results import made_once
from viewer_pictures import CLICKS, LOOKS, PICTURES, case, psnr, rendered
from written_viewers import with_third_painting, written_small

BROWSERS = [
    pytest.param(firefox, marks=needs_firefox, id="Firefox"),
    pytest.param(webkit, marks=needs_webkit, id="WebKit"),
]


@pytest.mark.parametrize("browser", BROWSERS)
def test_browser_and_cpu_agree_on_looks_and_mixtures(
    tiny, content, tmp_path: Path, browser: Browser
):
    scene, baked = tiny("unbounded"), content("unbounded")
    cases = [(scene.cameras[0], *LOOKS[k]) for k in (0, 3, 5)]
    page = written_small(baked, tmp_path / "viewer.html")
    asked = json.dumps([case(*each) for each in cases])
    answer = answer_of(page, PICTURES.replace("CASES", asked), 800, browser=browser)
    assert answer["errors"] == []
    of_cpu = made_once("looks of the CPU", lambda: [rendered(scene, baked, *c) for c in cases])
    for each, shot, expected in zip(cases, answer["shots"], of_cpu, strict=True):
        assert psnr(np.array(shot).reshape(expected.shape), expected) >= 45, each[1:]


@pytest.mark.parametrize("browser", BROWSERS)
def test_every_control_works_in_other_browsers(content, tmp_path: Path, browser: Browser):
    page = written_small(with_third_painting(content("ndc")), tmp_path / "viewer.html")
    answer = answer_of(page, CLICKS, 1000, seconds=120, browser=browser)
    assert answer["errors"] == []
    assert len(set(answer["sums"])) == len(answer["sums"])
    assert len({answer[name] for name in ("begin", "turned", "far", "zoomed")}) == 4
    assert (answer["isSplit"], answer["saved"], answer["look"]) == (True, 1, 1)
    assert (answer["over"], answer["end"]) == (0, answer["begin"])
