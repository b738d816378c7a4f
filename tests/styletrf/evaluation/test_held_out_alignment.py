"""Held-out views, measured with their cameras aligned to the field."""

import numpy as np
import pytest
import torch
from alignment_cases import camera, photograph, plane

from styletrf.evaluation.alignment.held_out_alignment import aligned_psnr
from styletrf.evaluation.metrics import psnr
from styletrf.files.images import to_integers


def view_image(render, true):
    return torch.from_numpy(to_integers(photograph(render, true)))


def test_a_camera_that_is_off_is_measured_where_it_belongs():
    render, true = plane(0), camera((0.03, -0.02, 0.02), (0.004, -0.006, 0.002))
    given = psnr(photograph(render, camera()), photograph(render, true))
    (found,) = aligned_psnr([camera()], [given], [view_image(render, true)], render)
    assert found > given + 6


def test_a_right_camera_loses_nothing():
    render = plane(1)
    image = view_image(render, camera())
    given = psnr(photograph(render, camera()), image.numpy() / 255.0)
    (found,) = aligned_psnr([camera()], [given], [image], render)
    assert found >= given


def test_pixels_that_do_not_count_have_no_part():
    render = plane(2)
    image = view_image(render, camera())
    alpha = torch.full((*image.shape[:2], 1), 255, dtype=torch.uint8)
    alpha[:, :40] = 0
    masked = torch.cat([image, alpha], dim=2)
    spoilt = masked.clone()
    spoilt[:, :40, :3] = 255 - spoilt[:, :40, :3]
    given = psnr(photograph(render, camera()), image.numpy() / 255.0)
    clean, dirty = (aligned_psnr([camera()], [given], [one], render)[0] for one in (masked, spoilt))
    assert np.isfinite([clean, dirty]).all()
    assert dirty == pytest.approx(clean, abs=3.0)
