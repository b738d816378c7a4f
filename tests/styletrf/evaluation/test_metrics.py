import math

import numpy as np
import pytest
from expected_errors import rejects

from styletrf.evaluation.metrics import mean_squared_error, psnr, ssim
from styletrf.psnr import bounded_psnr, psnr_of_error


@pytest.fixture
def image():
    y, x = np.mgrid[0:48, 0:64]
    waves = [np.sin(x / 3 + c) * np.cos(y / (4 + c)) for c in range(3)]
    return 0.5 + 0.3 * np.stack(waves, axis=-1)


def noisy(image, sigma, seed=0):
    return image + np.random.default_rng(seed).normal(0, sigma, image.shape)


def constant(value):
    return np.full((20, 24, 3), value)


def test_an_image_has_no_error_against_itself_in_any_measure(image):
    assert mean_squared_error(image, image) == 0
    assert psnr(image, image) == math.inf
    assert ssim(image, image) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("measure", [mean_squared_error, psnr, ssim])
def test_image_and_reference_may_change_places(measure, image):
    other = noisy(image, 0.1)
    assert measure(image, other) == pytest.approx(measure(other, image), rel=1e-12)


@pytest.mark.parametrize("difference", [1.0, 0.1, 0.01])
def test_psnr_of_a_constant_difference_is_its_closed_form(difference):
    assert psnr(constant(difference), constant(0.0)) == pytest.approx(-20 * math.log10(difference))


@pytest.mark.extremes("PSNR and SSIM")
def test_psnr_of_the_smallest_error_is_finite():
    assert math.isfinite(psnr_of_error(5e-324))


@pytest.mark.parametrize(("mse", "bounded"), [(0.0, 100.0), (1e-12, 100.0), (0.01, 20.0)])
def test_a_bounded_psnr_is_at_most_100_db(mse, bounded):
    assert bounded_psnr(mse) == pytest.approx(bounded)


@pytest.mark.parametrize(("a", "b"), [(0.2, 0.7), (0.0, 1.0), (0.5, 0.5)])
def test_ssim_of_constants_is_the_luminance_term(a, b):
    expected = (2 * a * b + 0.01**2) / (a * a + b * b + 0.01**2)
    assert ssim(constant(a), constant(b)) == pytest.approx(expected, rel=1e-9)


def test_ssim_of_a_scaled_contrast_is_the_structure_term():
    # x = m + d and y = m + g d, where d is a checkerboard, which the window averages to nothing
    d = np.where(np.indices((32, 32)).sum(axis=0)[..., None] % 2, 0.2, -0.2).repeat(3, axis=-1)
    gain, variance, c2 = 0.5, 0.04, 0.03**2
    expected = (2 * gain * variance + c2) / ((1 + gain**2) * variance + c2)
    assert ssim(0.5 + d, 0.5 + gain * d) == pytest.approx(expected, rel=1e-3)


def test_ssim_of_a_negative_is_negative(image):
    assert ssim(image, 1 - image) < 0


def test_measures_fall_as_noise_grows(image):
    sigmas = [0.01, 0.03, 0.1, 0.3]
    for measure in (psnr, ssim):
        values = [measure(noisy(image, sigma), image) for sigma in sigmas]
        assert values == sorted(values, reverse=True)
    assert psnr(noisy(image, 0.1), image) == pytest.approx(20, abs=0.3)


def test_a_mirrored_pair_is_as_similar(image):
    other = noisy(image, 0.1)
    assert ssim(image[:, ::-1], other[:, ::-1]) == pytest.approx(ssim(image, other), rel=1e-9)


def test_an_image_of_one_window_is_that_window(image):
    x, y = image[:11, :11, :1].repeat(3, -1), noisy(image, 0.1)[:11, :11, :1].repeat(3, -1)
    distance = np.arange(-5, 6) ** 2
    weights = np.exp(-(distance[:, None] + distance[None]) / (2 * 1.5**2))
    weights /= weights.sum()
    p, q = x[..., 0], y[..., 0]
    mp, mq = (weights * p).sum(), (weights * q).sum()
    spp, sqq = (weights * (p - mp) ** 2).sum(), (weights * (q - mq) ** 2).sum()
    spq = (weights * (p - mp) * (q - mq)).sum()
    c1, c2 = 0.01**2, 0.03**2
    expected = (2 * mp * mq + c1) * (2 * spq + c2) / ((mp**2 + mq**2 + c1) * (spp + sqq + c2))
    assert ssim(x, y) == pytest.approx(expected, rel=1e-9)


def test_half_and_single_precision_are_measured_in_double(image):
    single = image.astype(np.float32)
    assert mean_squared_error(single, single + np.float32(1e-4)) == pytest.approx(1e-8, rel=1e-2)


def test_the_masked_error_sees_the_mask_only(image):
    mask = np.zeros(image.shape[:2], dtype=bool)
    mask[:10] = True
    other = image.copy()
    other[10:] += 5
    other[:10] += 0.1
    assert mean_squared_error(other, image, mask) == pytest.approx(0.01)
    assert math.isnan(mean_squared_error(other, image, np.zeros_like(mask)))


def test_an_image_below_the_window_is_refused():
    with rejects("40x10", 11):
        ssim(np.zeros((10, 40, 3)), np.zeros((10, 40, 3)))
