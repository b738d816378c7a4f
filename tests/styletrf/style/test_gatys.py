"""A view optimized towards a style: nearer to it than it was, of its own size."""

from dataclasses import replace
from itertools import combinations

import pytest
import torch

from styletrf.style.gatys import GatysConfig, paint_by_optimization
from styletrf.style.perceptual.perceptual_loss import perceptual_loss, style_grams


@pytest.mark.parametrize(
    ("size", "start"), [((41, 52), "network"), ((41, 52), "noise"), ((16, 16), "content")]
)
def test_the_painted_view_is_nearer_to_the_style(vgg, size, start):
    generator = torch.Generator().manual_seed(0)
    content, style = (torch.rand(*s, 3, generator=generator) for s in (size, (64, 64)))
    config = GatysConfig(style_px=64, iterations=(15, 5), start=start)
    begin = 1 - content if start == "network" else None
    painted = paint_by_optimization(vgg, content, style, config, begin=begin)
    assert painted.shape == content.shape
    assert 0 <= painted.min() <= painted.max() <= 1
    grams = style_grams(vgg, style.permute(2, 0, 1)[None])
    before, after = (
        perceptual_loss(vgg, i.permute(2, 0, 1)[None], content.permute(2, 0, 1)[None], grams,
                        config.loss).total
        for i in (content, painted)
    )  # fmt: skip
    assert after < before


def test_a_stroke_scale_changes_the_view_however_few_pixels_the_painting_has(vgg):
    generator = torch.Generator().manual_seed(0)
    content, style = (torch.rand(s, s, 3, generator=generator) for s in (16, 32))
    usual = GatysConfig(style_px=64, iterations=(1,), start="content")
    views = [
        paint_by_optimization(vgg, content, style, replace(usual, stroke_scale=scale))
        for scale in (1.0, 1.5, 2.0)
    ]
    assert not any(torch.equal(a, b) for a, b in combinations(views, 2))


def test_the_start_from_a_network_needs_its_painting(vgg):
    with pytest.raises(ValueError, match="start"):
        paint_by_optimization(vgg, torch.rand(16, 16, 3), torch.rand(64, 64, 3), GatysConfig())
