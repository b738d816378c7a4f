"""What is the same thing moved has no temporal loss; what flickers has."""

import pytest
import torch
from expected_errors import rejects

from styletrf.configuration import configured
from styletrf.style.training.temporal_loss import (
    ContentPair,
    TemporalLossConfig,
    jittered_pair,
    temporal_loss,
    warp_along,
)


def smooth_images(batch: int = 2) -> torch.Tensor:
    y, x = torch.meshgrid(torch.linspace(0, 6, 40), torch.linspace(0, 6, 48), indexing="ij")
    waves = torch.stack([torch.sin(x + k) * torch.cos(y - k) for k in range(3 * batch)])
    return (0.5 + 0.4 * waves).reshape(batch, 3, 40, 48)


@pytest.mark.parametrize("name", ["weight", "shift_px", "noise"])
def test_a_negative_disturbance_or_weight_is_refused(name):
    with rejects(repr(name), name, "-0.5"):
        configured(TemporalLossConfig, {name: -0.5})


def test_a_shift_by_whole_pixels_is_exact():
    images = torch.rand(1, 2, 9, 11)
    flow = torch.tensor([3.0, -2.0]).expand(1, 9, 11, 2)
    seen, inside = warp_along(images, flow)
    torch.testing.assert_close(seen[:, :, 2:, :8], images[:, :, :7, 3:])
    assert inside[0, 2:, :8].all()
    assert inside.sum() == 7 * 8


@pytest.mark.parametrize("shift_px", [0.0, 1.5, 4.0])
def test_what_moves_with_the_photograph_is_steady(shift_px):
    config = TemporalLossConfig(shift_px=shift_px, noise=0.0)
    pair = jittered_pair(smooth_images(), config, torch.Generator().manual_seed(0))
    assert temporal_loss(pair.first, pair.second, pair) < 2e-3
    recolored = [1 - image for image in (pair.first, pair.second)]
    assert temporal_loss(*recolored, pair) < 2e-3


def test_strokes_that_stay_on_the_screen_are_not_steady():
    config = TemporalLossConfig(shift_px=4.0, noise=0.0)
    pair = jittered_pair(smooth_images(), config, torch.Generator().manual_seed(3))
    strokes = smooth_images().flip(-1)
    assert temporal_loss(strokes, strokes, pair) > 100 * temporal_loss(
        pair.first, pair.second, pair
    )


def test_noise_counts_by_its_variance():
    config = TemporalLossConfig(shift_px=0.0, noise=0.1)
    pair = jittered_pair(smooth_images(), config, torch.Generator().manual_seed(0))
    variance = pair.first.var(dim=(2, 3), unbiased=False).mean()
    torch.testing.assert_close(
        temporal_loss(pair.first, pair.second, pair), 0.01 / variance, rtol=0.1, atol=0
    )


def test_less_contrast_is_not_steadier():
    pair = jittered_pair(smooth_images(), TemporalLossConfig(), torch.Generator().manual_seed(0))
    strokes = torch.rand(2, 3, 40, 48), torch.rand(2, 3, 40, 48)
    faint = [0.5 + 0.2 * (image - 0.5) for image in strokes]
    torch.testing.assert_close(temporal_loss(*faint, pair), temporal_loss(*strokes, pair))


@pytest.mark.extremes("Temporal loss")
@pytest.mark.parametrize("value", [0.0, 0.5])
def test_a_picture_of_one_color_has_finite_temporal_loss(value):
    pair = jittered_pair(smooth_images(), TemporalLossConfig(), torch.Generator().manual_seed(0))
    flat = torch.full((2, 3, 40, 48), value, requires_grad=True)
    temporal_loss(flat, flat, pair).backward()
    assert torch.isfinite(flat.grad).all()


@pytest.mark.extremes("Temporal loss")
def test_nothing_valid_is_no_error_and_has_a_gradient_of_zero():
    first = torch.rand(1, 3, 8, 8, requires_grad=True)
    nowhere = ContentPair(
        first.detach(), torch.rand(1, 3, 8, 8), torch.zeros(1, 8, 8, 2), torch.zeros(1, 8, 8) > 0
    )
    value = temporal_loss(first, nowhere.second, nowhere)
    value.backward()
    assert value == 0
    assert (first.grad == 0).all()


def test_the_same_seed_disturbs_alike():
    images = smooth_images()
    pairs = [
        jittered_pair(images, TemporalLossConfig(), torch.Generator().manual_seed(5)) for _ in "ab"
    ]
    assert torch.equal(pairs[0].second, pairs[1].second)
