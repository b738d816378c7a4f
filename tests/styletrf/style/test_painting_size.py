"""A stroke scale is the factor of the size at which a painting is looked at, up to a bound."""

import math

import pytest
import torch
from message_words import mentions
from torch import Tensor

from styletrf.style.gatys import GatysConfig
from styletrf.style.perceptual import painting_size
from styletrf.style.perceptual.painting_size import (
    greatest_scale,
    scale_warnings,
    scaled_painting,
)
from styletrf.style.perceptual.perceptual_loss import shrunk
from styletrf.style.training.config import StyleTrainingConfig, with_style_parameters
from styletrf.stylization.strategies import StylizationConfig

SIDES = [(64, 64), (96, 64), (80, 200), (512, 100)]


def painting(height: int, width: int) -> Tensor:
    return torch.rand(height, width, 3, generator=torch.Generator().manual_seed(height + width))


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("style_px", [16, 64, 420])
def test_at_the_usual_scale_a_painting_is_reduced_to_the_bit_and_never_enlarged(sides, style_px):
    style = painting(*sides)
    assert torch.equal(scaled_painting(style, style_px, 1.0), shrunk(style, style_px))


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("style_px", [50, 420])
@pytest.mark.parametrize("scale", [0.5, 0.9, 1.22, 2.0, 4.0])
def test_both_sides_grow_by_the_scale_also_of_a_painting_with_fewer_pixels(sides, style_px, scale):
    usual, scaled = (scaled_painting(painting(*sides), style_px, s) for s in (1.0, scale))
    for before, after in zip(usual.shape[2:], scaled.shape[2:], strict=True):
        assert after == pytest.approx(scale * before, abs=0.5 + scale)


@pytest.mark.parametrize("scale", [1.5, 3.0])
def test_an_enlarged_painting_shows_the_painting(scale):
    x = torch.linspace(0, 6, 64)
    style = (0.5 + 0.5 * torch.sin(x[:, None] + torch.arange(3) + x[:, None, None])).contiguous()
    enlarged = scaled_painting(style, 420, scale)
    assert 0 <= enlarged.min() <= enlarged.max() <= 1
    again = shrunk(enlarged[0].permute(1, 2, 0), 64)[0].permute(1, 2, 0)
    torch.testing.assert_close(again, style, atol=0.02, rtol=0)


def test_edges_do_not_overshoot_where_a_painting_is_enlarged():
    style = torch.zeros(64, 64, 3)
    style[:, 32:] = 1
    enlarged = scaled_painting(style, 64, 2.0)
    assert (enlarged.min(), enlarged.max()) == (0, 1)


@pytest.mark.parametrize("sides", SIDES)
def test_beyond_the_greatest_scale_nothing_grows_and_a_warning_has_it(sides, monkeypatch):
    monkeypatch.setattr(painting_size, "LARGEST_SQUARE_PX", 128)
    style = painting(*sides)
    greatest = greatest_scale(style.shape, 50)
    largest = scaled_painting(style, 50, greatest)
    assert math.prod(largest.shape[2:]) == pytest.approx(128**2, rel=0.05)
    assert torch.equal(scaled_painting(style, 50, 10 * greatest), largest)
    assert scale_warnings(style.shape, 50, greatest) == []
    (warning,) = scale_warnings(style.shape, 50, 10 * greatest)
    assert mentions(warning, f"{10 * greatest:g}", f"{greatest:.3g}")


def test_the_bound_leaves_a_painting_as_it_is_at_the_usual_scale(monkeypatch):
    monkeypatch.setattr(painting_size, "LARGEST_SQUARE_PX", 32)
    style = painting(64, 400)
    assert torch.equal(scaled_painting(style, 64, 1.0), shrunk(style, 64))
    assert scale_warnings(style.shape, 64, 1.0) == []


@pytest.mark.parametrize("scale", [1e-9, 0.01])
def test_a_painting_is_never_reduced_below_what_networks_take(scale):
    assert min(scaled_painting(painting(64, 96), 64, scale).shape[2:]) == 16


@pytest.mark.parametrize("config", [StyleTrainingConfig(), GatysConfig()])
def test_the_stroke_scale_of_a_command_is_a_factor_of_that_of_the_settings(config):
    once = with_style_parameters(config, 2.0, 1.0)
    assert with_style_parameters(once, 3.0, 1.0).stroke_scale == 6 * config.stroke_scale
    assert StylizationConfig().with_style_parameters(2.0, 1.0).stroke_scale == once.stroke_scale
