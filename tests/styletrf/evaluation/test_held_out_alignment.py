"""Held-out views, measured with their cameras aligned to the field."""

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


@pytest.mark.parametrize("hidden", ["inverted", "moved"])
def test_pixels_that_do_not_count_have_no_part(hidden):
    """Neither in the alignment, which begins at a camera that is off, nor in its PSNR."""
    render, true = plane(2), camera((0.03, -0.02, 0.02), (0.004, -0.006, 0.002))
    image = view_image(render, true)
    alpha = torch.full((*image.shape[:2], 1), 255, dtype=torch.uint8)
    alpha[:, 80:] = 0
    masked = torch.cat([image, alpha], dim=2)
    spoilt = masked.clone()
    other = view_image(render, camera((0.2, 0.0, 0.0))) if hidden == "moved" else 255 - image
    spoilt[:, 80:, :3] = other[:, 80:]
    shown, reference = photograph(render, camera()), image.numpy() / 255.0
    given = psnr(shown[:, :80], reference[:, :80])
    clean, dirty = (aligned_psnr([camera()], [given], [one], render)[0] for one in (masked, spoilt))
    assert clean > given + 6
    assert dirty == pytest.approx(clean, abs=0.1)


def test_a_camera_stays_where_its_photograph_has_too_few_pixels_that_count():
    render, true = plane(2), camera((0.03, -0.02, 0.02))
    image = view_image(render, true)
    alpha = torch.zeros((*image.shape[:2], 1), dtype=torch.uint8)
    alpha[70, 90] = 255
    given = psnr(photograph(render, camera())[70:71, 90:91], image[70:71, 90:91].numpy() / 255.0)
    masked = torch.cat([image, alpha], dim=2)
    assert aligned_psnr([camera()], [given], [masked], render) == pytest.approx([given])
