"""Resemblance: the painting is nearest to itself, unstylized frames score 1, extremes end well."""

import math
import runpy
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from expected_errors import rejects

from styletrf.evaluation.resemblance.efficientnet_lite import load_efficientnet
from styletrf.evaluation.resemblance.frame_resemblance import (
    STYLE_DISTANCES,
    ResemblanceConfig,
    content_style_product,
    measure_resemblance,
)
from styletrf.evaluation.resemblance.picture_traits import (
    TraitMeter,
    TraitsConfig,
    content_distance,
    distances,
    nearest_painting,
    reduced,
)
from styletrf.evaluation.resemblance.sliced_wasserstein import SlicedWassersteinConfig
from styletrf.evaluation.sharpness import sharpness
from styletrf.files.images import write_png
from styletrf.style.perceptual.vgg import VGG16

CONFIG = TraitsConfig(96, 64, SlicedWassersteinConfig(samples=1000))


@pytest.fixture(scope="module")
def meter() -> TraitMeter:
    torch.manual_seed(0)
    return TraitMeter(VGG16().requires_grad_(requires_grad=False), load_efficientnet(), CONFIG)


def picture(seed: int, height: int = 48, width: int = 64, cell: int = 4) -> np.ndarray:
    coarse = np.random.default_rng(seed).random((height // cell, width // cell, 3))
    tinted = coarse ** (1 + seed % 3)
    return np.kron(tinted, np.ones((cell, cell, 1))).astype(np.float32)


def smooth(width: int) -> np.ndarray:
    """One picture at any size: waves of ten pixels or more where it has 64."""
    x, y = np.meshgrid(*((np.arange(n) + 0.5) * 64 / width for n in (width, width * 3 // 4)))
    waves = [np.sin(x / a + y / b) for a, b in ((3, 5), (4, -2.5), (-2, 6))]
    return (0.5 + 0.4 * np.dstack(waves)).astype(np.float32)


def measured(meter: TraitMeter, plain, stylized, painting, priors=(), frames=2, objects=None):
    config = ResemblanceConfig(frames=frames, traits=CONFIG)
    return measure_resemblance(
        ["a", "b", "c"], lambda _: (plain, stylized), painting, priors, meter, config,
        objects=objects,
    )  # fmt: skip


def test_the_painting_is_no_way_from_itself_and_the_nearest_to_itself(meter: TraitMeter):
    frame = picture(0)
    paintings = {f"{k}": meter.of_painting(picture(k), frame) for k in range(1, 5)}
    for name, traits in paintings.items():
        assert distances(traits, traits) == pytest.approx(dict.fromkeys(STYLE_DISTANCES, 0.0),
                                                          abs=1e-6)  # fmt: skip
        assert set(nearest_painting(traits, paintings).values()) == {name}


@pytest.mark.parametrize("shape", [(72, 96), (48, 144), (144, 48), (96, 288)])
def test_a_painting_of_any_proportions_is_seen_at_the_scale_of_the_frame(meter: TraitMeter, shape):
    """It has as many pixels as the frame, so VGG16 has as many places in it."""
    frame = picture(0, 72, 96)
    painting = meter.of_painting(picture(1, *shape), frame)
    assert painting.content.shape == meter.of_frame(frame).content.shape


def test_unstylized_frames_have_ratios_of_one_and_lose_nothing(meter: TraitMeter):
    frame, painting = picture(0), picture(1)
    rows, summary = measured(meter, frame, frame, painting)
    assert [row.view for row in rows] == ["a", "c"]
    assert [summary[f"{name}_ratio"] for name in STYLE_DISTANCES] == [1.0] * len(STYLE_DISTANCES)
    assert summary["content"] == pytest.approx(0, abs=1e-5)
    assert summary["content_style_product"] == pytest.approx(2, abs=1e-4)
    assert (summary["sharpness_to_priors"], summary["sharpness_to_unstylized"]) == (None, 1)


def test_the_painting_in_place_of_the_frames_has_ratios_of_zero(meter: TraitMeter):
    frame, painting = picture(0), picture(1)
    _, summary = measured(meter, frame, painting, painting, [frame, frame])
    for name in STYLE_DISTANCES:
        assert summary[f"{name}_ratio"] == pytest.approx(0, abs=1e-6)
        assert summary[f"{name}_unstylized"] > 0
    assert summary["content"] > 0
    assert summary["sharpness_to_priors"] == pytest.approx(sharpness(painting) / sharpness(frame))


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_sharpness_of_one_picture_is_the_priors_whatever_their_size(meter: TraitMeter, scale):
    frame = smooth(64)
    prior = reduced(smooth(128), round(64 * scale)) if scale != 1 else frame
    _, summary = measured(meter, frame, frame, picture(1), [prior], frames=1)
    close = 1e-12 if scale == 1 else 0.05
    assert summary["sharpness_to_priors"] == pytest.approx(1, abs=close)
    assert summary["sharpness_to_priors"] * summary["sharpness_priors"] == pytest.approx(
        summary["sharpness"]
    ), "which stand beside each other in the report"


@pytest.mark.parametrize("width", [64, 128])
def test_sharpness_beside_priors_as_large_is_that_of_the_frame_as_it_is_looked_at(
    meter: TraitMeter, width
):
    frame = picture(0, width * 3 // 4, width)
    rows, summary = measured(meter, frame, frame, picture(1), [frame], frames=1)
    assert rows[0].sharpness == meter.of_frame(frame).sharpness == summary["sharpness_priors"]


@pytest.mark.parametrize(("sharpness_px", "reductions"), [(None, 1), (200, 1), (96, 1), (64, 2)])
def test_a_large_frame_is_reduced_once_where_its_sharpness_is_measured_at_that_size(
    meter: TraitMeter, monkeypatch, sharpness_px, reductions
):
    frame, shapes, resize = picture(0, 96, 128), [], cv2.resize

    def noted(image, *size, **options):
        shapes.append(image.shape)
        return resize(image, *size, **options)

    monkeypatch.setattr(cv2, "resize", noted)
    traits = meter.of_frame(frame, sharpness_px)
    assert shapes.count(frame.shape) == reductions
    assert traits.sharpness == sharpness(reduced(frame, min(sharpness_px or 96, 96)))


def test_a_scene_that_is_the_painting_has_no_ratios(meter: TraitMeter):
    _, summary = measured(meter, picture(0), picture(1), picture(0))
    assert summary["style_swd_patches_ratio"] is None
    assert summary["content_style_product"] is None
    assert summary["style_swd_patches"] > 0


def test_content_is_lost_place_by_place(meter: TraitMeter):
    a, b = meter.of_frame(picture(0)), meter.of_frame(picture(0)[:, ::-1].copy())
    assert content_distance(a, a) == pytest.approx(0, abs=1e-5)
    assert 0 < content_distance(a, b) == pytest.approx(content_distance(b, a))


@pytest.mark.parametrize("painting", [
    np.zeros((64, 64, 3), np.float32), np.ones((64, 64, 3), np.float32), picture(1, 16, 16),
    picture(2, 8, 4000), np.random.default_rng(0).random((900, 40, 3)).astype(np.float32),
], ids=["black", "white", "16 px", "long", "noise"])  # fmt: skip
def test_resemblance_of_extreme_frames_and_paintings_is_finite(meter: TraitMeter, painting):
    for frame in (picture(0), np.zeros((48, 64, 3), np.float32), picture(3, 16, 16)):
        stylized = picture(4, *frame.shape[:2])
        _, summary = measured(meter, frame, stylized, painting, frames=1)
        assert all(value is None or math.isfinite(value) for value in summary.values())


def test_frames_of_other_names_are_paired_in_the_order_of_their_numbers(tmp_path):
    script = runpy.run_path(str(Path(__file__).parents[3] / "benchmarks/jury.py"))
    for folder, name in (("plain", "{:02d}"), ("painted", "frame_{}")):
        (tmp_path / folder).mkdir()
        for number in (1, 2, 10):
            level = np.full((8, 8, 3), number, np.uint8)
            write_png(tmp_path / folder / f"{name.format(number)}.png", level, compression=1)
    result = script["Result"]("", tmp_path, tmp_path / "painted", tmp_path / "plain")
    views = result.views(3)
    assert len(views) == 3
    assert all(np.array_equal(plain, painted) for plain, painted in views)


def test_a_frame_of_few_pixels_is_refused(meter: TraitMeter):
    with rejects("100x7", 8):
        meter.of_frame(np.zeros((7, 100, 3), np.float32))


def test_doing_nothing_and_hanging_up_the_painting_are_both_two():
    assert content_style_product(0.0, 1.0) == content_style_product(1.0, 0.0) == 2
    assert content_style_product(0.0, 0.0) == 1


def test_an_object_is_compared_with_the_painting_and_its_frame_with_the_scene(meter: TraitMeter):
    plain, painting = picture(0), picture(5)
    white = np.ones_like(plain)
    _, seen = measured(meter, plain, white, painting)
    _, alone = measured(meter, plain, white, painting, objects=lambda _: (plain, painting))
    assert all(alone[f"{name}_ratio"] == pytest.approx(0, abs=1e-3) for name in STYLE_DISTANCES)
    for name in ("content", "sharpness_to_unstylized"):
        assert alone[name] == seen[name]
