"""Measures of images, colors and float files: equal, flat, saturated and infinite."""

import math

import numpy as np
import pytest
import torch
from stability import half_rounding

from styletrf.evaluation.flow import FlowEstimator, agreement, warp_to_a
from styletrf.evaluation.metrics import mean_squared_error, psnr, ssim
from styletrf.field.kernels import Samples
from styletrf.field.training.distortion import distortion
from styletrf.files.float_images import read_float_image, write_float_image
from styletrf.style.training.temporal_loss import ContentPair, temporal_loss, warp_along
from styletrf.stylization.color_transfer import Colors, in_colors

METRICS = pytest.mark.extremes("PSNR and SSIM")
COLORS = pytest.mark.extremes("Color transfer")
TEMPORAL = pytest.mark.extremes("Temporal loss")
FLOW = pytest.mark.extremes("Optical flow and warping")
FILES = pytest.mark.extremes("Float images")
DISTORTION = pytest.mark.extremes("Distortion")


def constant(value: float, dtype=np.float32) -> np.ndarray:
    return np.full((20, 24, 3), value, dtype=dtype)


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((20, 24, 3), dtype=np.float32)


@METRICS
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
@pytest.mark.parametrize("difference", [0.0, 1e-7, 1e-3, 1.0])
def test_psnr_of_a_constant_difference_at_any_level(dtype, difference, stability):
    """-20 log10 of it, infinite for none; images are widened before they are subtracted."""
    image, reference = constant(difference, dtype), constant(0.0, dtype)
    stored = float(image[0, 0, 0])
    exact = -20 * math.log10(stored) if stored else math.inf
    assert psnr(image, reference) == pytest.approx(exact)
    stability(f"difference {difference:g}", psnr(image, reference), exact,
              precision=np.dtype(dtype).name)  # fmt: skip


@METRICS
@pytest.mark.parametrize("contrast", [0.0, 1e-7, 1e-3, 1.0])
@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
def test_ssim_of_an_image_with_itself_is_1(contrast, level, stability):
    """Also where the variance is a small difference of large squares."""
    image = (level + contrast * (noise() - 0.5)).astype(np.float32)
    assert ssim(image, image) == pytest.approx(1, abs=1e-12)
    stability(f"contrast {contrast:g}, level 0 to 1", ssim(image, image), 1.0, precision="float32")


@METRICS
@pytest.mark.parametrize("level", [1e-20, 1e20, 1e100])
def test_ssim_stays_within_its_bounds_at_any_level(level, stability):
    a, b = level * noise(0).astype(np.float64), level * noise(1).astype(np.float64)
    assert -1 - 1e-9 <= ssim(a, b) <= 1 + 1e-9
    exact = level**2 * mean_squared_error(a / level, b / level)
    stability(f"squared error, values of {level:g}", mean_squared_error(a, b), exact)


@COLORS
@pytest.mark.parametrize("colors", ["style", "photograph", "luminance"])
@pytest.mark.parametrize("painted", ["black", "white", "faint", "noise"])
def test_any_painted_view_gets_colors_in_range(colors: Colors, painted, stability):
    """Also from and to pictures without any contrast, whose covariance is singular."""
    views = {"black": constant(0.0), "white": constant(1.0), "noise": noise(),
             "faint": constant(0.5) + 1e-6 * noise()}  # fmt: skip
    for plain in views.values():
        shown = in_colors([views[painted]], [plain], noise(3), colors)[0]
        wide = in_colors(
            [views[painted].astype(np.float64)], [plain.astype(np.float64)],
            noise(3).astype(np.float64), colors,
        )[0]  # fmt: skip
        assert ((shown >= 0) & (shown <= 1)).all()
        stability(f"{painted}, colors of {colors}", shown, wide, within=1e-4)


@TEMPORAL
@pytest.mark.parametrize("flow_px", [0.0, 1e-6, 1e6, 1e30, float("inf")])
def test_what_flows_out_of_the_picture_does_not_count(flow_px, stability):
    image = torch.from_numpy(noise()).permute(2, 0, 1)[None]
    flow = torch.full((1, 20, 24, 2), flow_px)
    seen, inside = warp_along(image, flow)
    assert torch.isfinite(seen).all()
    assert bool(inside.any()) == (flow_px < 1)
    pair = ContentPair(image, image, flow, torch.ones(1, 20, 24) > 0)
    wide = ContentPair(image.double(), image.double(), flow.double(), pair.valid)
    found = temporal_loss(image, image, pair)
    assert found < 1e-6
    exact = temporal_loss(wide.first, wide.second, wide)
    stability(f"flow of {flow_px:g} px", found, exact, absolute=True)


@TEMPORAL
@pytest.mark.parametrize("contrast", [0.0, 1e-20, 1e-4, 1.0, 1e10])
def test_temporal_loss_of_any_contrast_is_finite(contrast, stability):
    first, second = (
        (contrast * torch.from_numpy(noise(k)).permute(2, 0, 1)[None]).requires_grad_()
        for k in range(2)
    )
    pair = ContentPair(
        first.detach(), second.detach(), torch.zeros(1, 20, 24, 2), torch.ones(1, 20, 24) > 0
    )
    found = temporal_loss(first, second, pair)
    found.backward()
    assert torch.isfinite(first.grad).all()
    exact = temporal_loss(first.double(), second.double(), pair)
    stability(f"contrast {contrast:g}", found, exact)


@FLOW
@pytest.mark.parametrize("method", ["dis", "farneback", "deepflow"])
@pytest.mark.parametrize("level", [0.0, 1.0])
def test_flat_frames_do_not_move(method, level, stability):
    flow = FlowEstimator(method)(constant(level), constant(level))
    np.testing.assert_allclose(flow, 0, atol=1e-3)
    assert agreement(flow, flow).all()
    stability(f"{method}, flat frames", flow, 0 * flow)


@FLOW
@pytest.mark.parametrize("flow_px", [1e4, 1e9, 1e30])
def test_a_flow_of_any_length_leads_to_the_border(flow_px, stability):
    image = noise()
    warped, inside = warp_to_a(image, np.full((20, 24, 2), flow_px, dtype=np.float32))
    assert not inside.any()
    np.testing.assert_array_equal(warped, np.broadcast_to(image[-1, -1], image.shape))
    stability(f"flow of {flow_px:g} px", warped, np.broadcast_to(image[-1, -1], image.shape))


@FILES
@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-5, 1.0, 65504.0])
def test_colors_return_within_half_precision_and_depth_exactly(tmp_path, size, stability):
    color = (size * noise()).astype(np.float32)
    depth = np.geomspace(1e-30, 1e30, 480, dtype=np.float32).reshape(20, 24)
    depth[0, 0] = np.inf
    write_float_image(tmp_path / "a.exr", color, color[..., 0] * 0 + 1, depth)
    image = read_float_image(tmp_path / "a.exr")
    assert (np.abs(image.color - color) <= 2.0**-11 * color + 2.0**-25).all()
    np.testing.assert_array_equal(image.depth, depth)
    stability(
        f"colors up to {size:g}", image.color, color, precision="float16",
        within=half_rounding(size),
    )  # fmt: skip
    stability("depths 1e-30 to 1e30 and infinite", image.depth, depth)


@DISTORTION
@pytest.mark.parametrize("size", [0.0, 1e-30, 1.0])
def test_the_distortion_of_one_ray_is_its_double_sum(size, stability):
    from kernel_cases import segments_between, with_steps

    n = 4000
    s, weights = (torch.arange(n) + 0.5) / n, torch.full((n,), size / n)
    rays = with_steps(segments_between(torch.zeros(1, 3), torch.ones(1, 3), 1), n)
    samples = Samples(
        torch.tensor([0, n]), torch.zeros(n, dtype=torch.int64), s, torch.zeros(n, 3), weights
    )
    found, w = distortion(samples, rays), weights.double()
    pairs = (w[:, None] * w[None] * (s.double()[:, None] - s.double()[None]).abs()).sum()
    exact = pairs + w.square().sum() / n / 3
    torch.testing.assert_close(found.double(), exact, rtol=1e-6, atol=1e-45)
    stability(f"{n} samples of together {size:g}", found, exact, absolute=size < 1e-20)
