"""Painting, style training and measures stop at what is not finite, with tensor and input."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from expected_errors import rejects, stops
from mini_scene import painted_plane
from moving_camera import FRAMES, pan, shown, texture
from tiny_style_training import TINY, style, trained

from styletrf.content.content_images import ContentConfig, write_content_images
from styletrf.content.content_sources import embedded_source
from styletrf.evaluation.consistency.flow_consistency import flow_errors
from styletrf.evaluation.consistency.trajectory_consistency import (
    ConsistencyConfig,
    measure_consistency,
)
from styletrf.evaluation.flow import FlowEstimator
from styletrf.evaluation.perceptual_distance import PerceptualFeatures
from styletrf.evaluation.quality import measure_quality
from styletrf.evaluation.stylization_loss import StylizationLossConfig, measure_stylization
from styletrf.field.rendering import Rendering
from styletrf.style.gatys import GatysConfig, paint_by_optimization
from styletrf.style.interchange import from_fast_neural_style, to_fast_neural_style
from styletrf.style.style_network import StyleNetwork, StyleNetworkConfig, stylize
from styletrf.style.training.step import StyleStep
from styletrf.style.training.trainer import begin
from styletrf.stylization.painters import painted

CPU = torch.device("cpu")


def network() -> StyleNetwork:
    return StyleNetwork(StyleNetworkConfig(2, 1), torch.Generator().manual_seed(0))


def infinite_weight(spoilt: StyleNetwork) -> None:
    spoilt.decoder[-1].weight.data[0, 0] = torch.inf


def overflow(spoilt: StyleNetwork) -> None:
    spoilt.decoder[-1].weight.data.fill_(3e38)


@pytest.mark.parametrize(
    ("spoil", "level", "tensor"),
    [
        (infinite_weight, 0.5, "parameter decoder.11.weight"),
        (overflow, 0.5, "painted image"),
        (lambda _: None, torch.nan, "image"),
    ],
)  # fmt: skip
def test_a_painting_names_view_and_tensor_before_it_is_clamped(spoil, level, tensor):
    spoilt, views = network(), [np.random.default_rng(k).random((16, 16, 3)) for k in range(2)]
    spoil(spoilt)
    views = [view.astype(np.float32) for view in views]
    views[1] = views[1] + np.float32(level)
    names = ["0008", "0009"]  # of a shard
    first = names[0] if level == 0.5 else names[1]
    with stops("painting", tensor, f"in view {first}"):
        painted(lambda image: stylize(spoilt, image), names, views)


def test_an_optimized_painting_names_its_view(vgg):
    view, config = (
        torch.full((16, 16, 3), torch.nan),
        GatysConfig(style_px=32, iterations=(2,), start="content"),
    )
    with stops("painting by optimization", "view", "at iteration 1"):
        paint_by_optimization(vgg, view, style(), config)


def test_a_style_training_names_content_that_is_not_finite(vgg):
    training, config = begin(replace(TINY, identity_iterations=0), CPU)
    content = torch.full((1, 3, 32, 32), torch.nan)
    with rejects("style training", "nan", "iteration 1", "a content image"):
        StyleStep(config, vgg, style())(training, 0, content)


def test_a_style_training_does_not_end_with_a_network_that_is_not_finite(
    vgg, tmp_path, monkeypatch
):
    write_content_images(
        embedded_source([], n_procedural=8, seed=0), tmp_path, ContentConfig(min_side_px=64)
    )
    whole = StyleStep.__call__

    def spoiling(step, training, k, content):
        terms = whole(step, training, k, content)
        if k == TINY.iterations - 1:
            training.network.decoder[-1].bias.data[0] = torch.nan
        return terms

    monkeypatch.setattr(StyleStep, "__call__", spoiling)
    with stops("style training", "parameter decoder.11.bias", "at iteration 8"):
        trained(TINY, vgg, tmp_path, tmp_path / "run")
    assert not list((tmp_path / "run").iterdir())


def test_a_network_that_is_given_is_finite(tmp_path):
    state = to_fast_neural_style(network())
    state["res1.conv2.conv2d.bias"][0] = torch.nan
    torch.save(state, tmp_path / "p.pth")
    with rejects(tmp_path / "p.pth", "res1.conv2.conv2d.bias"):
        from_fast_neural_style(tmp_path / "p.pth")


@pytest.mark.parametrize("kind", ["stylized", "unstylized"])
def test_consistency_names_the_frame_that_is_not_finite(vgg, kind):
    frames = {name: pan(texture(k)) for k, name in enumerate(("unstylized", "stylized"))}
    frames[kind][2] = np.full_like(frames[kind][2], np.nan)
    look = PerceptualFeatures(vgg, 32)
    with stops("consistency", kind, "in frame 2"):
        measure_consistency(
            shown(frames["unstylized"], frames["stylized"], None), FRAMES, texture(1), look,
            ConsistencyConfig(),
        )  # fmt: skip


def test_a_flow_that_is_not_finite_is_named():
    estimator = FlowEstimator()
    estimator._estimate = lambda a, _: np.full((*a.shape[:2], 2), np.nan)
    frames = (texture(0), texture(0))
    with stops("consistency", "flow", "by dis"):
        flow_errors(frames, frames, estimator)


def test_losses_and_figures_name_their_frame(vgg, tmp_path):
    scene = painted_plane()
    bad = np.full_like(texture(0), np.nan)
    with stops("stylization loss", "stylized", "in frame 0"):
        measure_stylization(
            ["0"], lambda _: (texture(0), bad), texture(1), vgg, StylizationLossConfig(1)
        )
    whole = torch.ones(scene.images.shape[1:3])
    renders = [Rendering(scene.images[0] / 255, *[whole] * 3)]
    metrics = {"psnr": lambda *_: math.inf, "perceptual": lambda *_: math.nan}
    with stops("quality", "perceptual", "in view 0"):
        measure_quality(renders, scene.cameras[:1], scene.images[:1], metrics, tmp_path)
