"""The PSNR to expect of a fit: the law of gains, and that views set aside stay unseen."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from mini_scene import KERNELS, MINI_FIT, painted_plane, photographs_of

from styletrf.capture.views import split_views
from styletrf.evaluation import expected_quality
from styletrf.evaluation.expected_quality import (
    brief_fits,
    expected_psnr,
    extrapolated_psnr,
    shortened,
)
from styletrf.field.rendering import RenderConfig
from styletrf.field.training.field_training import train_field
from styletrf.files.images import read_rgb, write_rgb

CPU = torch.device("cpu")
FIT = replace(MINI_FIT, iterations=400)
DECIBELS = st.floats(5, 60)


@given(first=DECIBELS, gain=st.floats(-3, 6), ratio=st.floats(0.1, 0.95), steps=st.integers(0, 9))
def test_gains_that_fall_by_the_ratio_are_continued_exactly(first, gain, ratio, steps):
    curve = [first]
    for k in range(steps + 1):
        curve.append(curve[-1] + gain * ratio**k)
    found = extrapolated_psnr(curve[0], curve[1], float(steps), ratio)
    assert found == pytest.approx(curve[-1], abs=1e-9)


@given(brief=DECIBELS, gain=st.floats(0.01, 6), ratio=st.floats(0.1, 0.9))
def test_more_iterations_are_better_and_bounded(brief, gain, ratio):
    few, more, endless = (
        extrapolated_psnr(brief - gain, brief, doublings, ratio) for doublings in (1.0, 3.0, 200.0)
    )
    assert brief < few < more <= endless
    assert endless == pytest.approx(brief + gain * ratio / (1 - ratio))


def test_a_shortened_fit_still_looks_for_what_is_empty_several_times():
    brief = shortened(FIT, 16)
    assert brief.iterations // brief.occupancy_every >= 8
    assert brief.early_gain_db == 0, "a brief fit does not end early"
    kept = {name: getattr(FIT, name) for name in ("iterations", "occupancy_every", "early_gain_db")}
    assert replace(brief, **kept) == FIT


def test_a_fit_of_a_plane_is_expected_to_get_better_with_its_iterations(tmp_path):
    photographs, model = photographs_of(painted_plane(9), tmp_path)
    half, brief = brief_fits(photographs, model, FIT, KERNELS, CPU)
    assert brief.iterations == 2 * half.iterations
    assert 10 < half.psnr_db < brief.psnr_db
    assert expected_psnr(photographs, model, FIT, KERNELS, CPU) > brief.psnr_db


def test_the_expectation_does_not_depend_on_how_many_rays_are_rendered_at_once(tmp_path):
    photographs, model = photographs_of(painted_plane(9), tmp_path)
    brief = replace(FIT, iterations=160)
    whole = brief_fits(photographs, model, brief, KERNELS, CPU)
    few = RenderConfig(tile=300)
    with patch.object(expected_quality, "RenderConfig", lambda: few):
        tiled = brief_fits(photographs, model, brief, KERNELS, CPU)
    assert [fit.psnr_db for fit in tiled] == pytest.approx([fit.psnr_db for fit in whole], abs=1e-3)


def test_of_one_photograph_nothing_is_expected(tmp_path):
    """It was set aside, and nothing was left to fit to."""
    photographs, model = photographs_of(painted_plane(1), tmp_path)
    assert expected_psnr(photographs, model, FIT, KERNELS, CPU) is None


@pytest.mark.parametrize("places", [0, 2])
def test_of_views_of_which_one_place_is_left_to_fit_to_nothing_is_expected(tmp_path, places):
    """Of two panoramas one is set aside: the other was fitted alone, at made-up depth."""
    photographs, model = photographs_of(painted_plane(8), tmp_path)
    cameras = [
        replace(camera, world_from_camera=photographs.cameras[k % 2].world_from_camera)
        for k, camera in enumerate(photographs.cameras[: 4 * places])
    ]
    assert brief_fits(replace(photographs, cameras=cameras), model, FIT, KERNELS, CPU) == []


def test_by_a_photograph_that_is_masked_all_over_nothing_is_expected(tmp_path):
    photographs, model = photographs_of(painted_plane(4), tmp_path)
    (aside,) = split_views(len(photographs.cameras))[1]
    (tmp_path / "masks").mkdir()
    black = np.zeros_like(read_rgb(photographs.folder / "0.png"))
    write_rgb(tmp_path / "masks" / f"{photographs.cameras[aside].name}.png", black)
    assert expected_psnr(photographs, model, FIT, KERNELS, CPU) is None


def test_views_of_a_panorama_are_set_aside_together(tmp_path):
    """A view that is set aside alone shows what others do that were taken from its place."""
    photographs, model = photographs_of(painted_plane(8), tmp_path)
    cameras = list(photographs.cameras)
    cameras[4] = replace(cameras[4], world_from_camera=cameras[3].world_from_camera)
    panoramas = replace(photographs, cameras=cameras)
    with patch.object(expected_quality, "train_field", wraps=train_field) as fits:
        brief_fits(panoramas, model, FIT, KERNELS, CPU)
    assert [camera.name for camera in fits.call_args.args[0].cameras] == [*"012567"]


def test_a_photograph_set_aside_is_measured_by_and_not_fitted_to(tmp_path):
    photographs, model = photographs_of(painted_plane(8), tmp_path)
    (_, before) = brief_fits(photographs, model, FIT, KERNELS, CPU)
    (aside,) = split_views(len(photographs.cameras))[1]
    path = photographs.folder / f"{photographs.cameras[aside].name}.png"
    write_rgb(path, 1 - read_rgb(path))
    (_, inverted) = brief_fits(photographs, model, FIT, KERNELS, CPU)
    write_rgb(path, np.ones_like(read_rgb(path)) - read_rgb(path))
    (_, again) = brief_fits(photographs, model, FIT, KERNELS, CPU)
    assert inverted.psnr_db < before.psnr_db - 3, "a field that had seen it would show it"
    assert again.psnr_db == pytest.approx(before.psnr_db, abs=0.05)
