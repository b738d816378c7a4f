"""The page in Firefox: pictures are those that the CPU renders, and every control works."""

import json
from pathlib import Path

import numpy as np
from firefox import firefox, needs_firefox
from headless import answer_of, with_text
from viewer_pictures import CLICKS, LOOKS, PICTURES, case, psnr, rendered
from written_viewers import written

pytestmark = needs_firefox


def test_firefox_and_cpu_agree_on_looks_and_mixtures(tiny, content, tmp_path: Path):
    scene, baked = tiny("unbounded"), content("unbounded")
    cases = [(scene.cameras[0], *LOOKS[k]) for k in (0, 3, 5)]
    page = written(baked, tmp_path / "viewer.html")
    asked = json.dumps([case(*each) for each in cases])
    answer = answer_of(page, PICTURES.replace("CASES", asked), 800, browser=firefox)
    assert answer["errors"] == []
    for each, shot in zip(cases, answer["shots"], strict=True):
        expected = rendered(scene, baked, *each)
        assert psnr(np.array(shot).reshape(expected.shape), expected) >= 45, each[1:]


def test_every_control_works_in_firefox(content, tmp_path: Path):
    page = written(content("ndc"), tmp_path / "viewer.html")
    with_text(page, page, '"mostPixels": 1600', '"mostPixels": 160')
    answer = answer_of(page, CLICKS, 1000, seconds=120, browser=firefox)
    assert answer["errors"] == []
    assert len(set(answer["sums"])) == len(answer["sums"])
    assert len({answer[name] for name in ("begin", "turned", "far", "zoomed")}) == 4
    assert (answer["isSplit"], answer["saved"], answer["look"]) == (True, 1, 1)
    assert (answer["over"], answer["end"]) == (0, answer["begin"])
