"""A field's colors, shown and compared as each photograph was exposed."""

import numpy as np
import pytest
import torch

from styletrf.evaluation.exposed_image import exposed_as, psnr_exposed
from styletrf.evaluation.metrics import psnr
from styletrf.field.training.view_exposures import ViewExposures, view_exposures
from styletrf.geometry.cameras import Camera
from styletrf.scene.exposures import MIDDLE, Exposure, Exposures

CPU = torch.device("cpu")
LOG_GAIN = torch.tensor([[0.3, -0.2, 0.1], [0.0, 0.0, 0.0]])
POWER = torch.tensor([[1.2, 0.8, 1.0], [1.0, 1.0, 1.0]])
EXPOSURES = ViewExposures(LOG_GAIN, POWER)


def test_colors_are_shown_as_the_estimate_takes_them_back():
    color, view = torch.rand((50, 3), generator=torch.Generator().manual_seed(0)), torch.arange(50)
    color, view = 0.05 + 0.9 * color, view % 2
    shown = EXPOSURES.shown(color, view, torch.zeros_like(color))
    back = Exposures(LOG_GAIN.numpy(), POWER.numpy()).evened(shown.numpy(), view.numpy())
    np.testing.assert_allclose(back, color, rtol=1e-5)
    torch.testing.assert_close(shown[view == 1], color[view == 1])


def test_saturated_pixels_say_only_that_it_is_at_least_so_bright():
    color = torch.full((1, 3), 0.98, requires_grad=True)
    view, white = torch.zeros(1, dtype=torch.long), torch.ones(1, 3)
    error = (EXPOSURES.shown(color, view, white) - white)[:, 0].square().sum()
    error.backward()
    assert error == 0
    assert color.grad is not None
    assert not color.grad.any()
    assert (EXPOSURES.shown(color, view, 0.9 * white)[:, 0] > 1).all()


@pytest.mark.parametrize(("least", "most"), [(0.1, 1.1), (1e-5, 1.9e-3)])
def test_gradients_of_the_shown_colors_are_those_of_finite_differences(least, most):
    """Also of colors that are nearly black."""
    exposures = ViewExposures(LOG_GAIN.double(), POWER.double())
    drawn = torch.rand((4, 3), generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    color = drawn.mul(most - least).add(least).requires_grad_()
    view, dark = torch.tensor([0, 1, 0, 1]), torch.zeros(4, 3)
    assert torch.autograd.gradcheck(lambda c: exposures.shown(c, view, dark), color)


def test_black_has_a_finite_gradient_by_which_it_can_become_brighter():
    color = torch.zeros((1, 3), requires_grad=True)
    EXPOSURES.shown(color, torch.zeros(1, dtype=torch.long), torch.zeros(1, 3)).sum().backward()
    assert torch.isfinite(color.grad).all()
    assert (color.grad > 0).all()


def test_brighter_colors_are_shown_brighter_without_a_leap_from_black_on():
    color = torch.linspace(0, 0.01, 1000, dtype=torch.float64)[:, None].expand(-1, 3)
    shown = EXPOSURES.shown(color, torch.zeros(1000, dtype=torch.long), torch.zeros(1000, 3))
    steps = shown.diff(dim=0)
    assert (shown[0] == 0).all()
    assert (steps > 0).all()
    assert (steps < 2 * steps[0]).all()


def test_views_have_the_exposures_of_their_names():
    cameras = [Camera(name, 8, 8, 8.0, 8.0, 4.0, 4.0, np.eye(4)[:3]) for name in "ba"]
    named = {"a": Exposure((0.1,) * 3, (1.0,) * 3), "b": Exposure((0.2,) * 3, (2.0,) * 3)}
    found = view_exposures(cameras, named, CPU)
    assert found is not None
    torch.testing.assert_close(found.log_gain[:, 0], torch.tensor([0.2, 0.1]))
    torch.testing.assert_close(found.power[:, 0], torch.tensor([2.0, 1.0]))
    assert view_exposures(cameras, {}, CPU) is None


@pytest.mark.parametrize(("gain", "power"), [(1.0, 1.0), (0.8, 1.0), (1.1, 0.8), (0.7, 1.3)])
def test_a_photograph_of_another_exposure_is_like_the_render_once_exposed(gain, power):
    image = np.random.default_rng(0).uniform(0.1, 0.7, (32, 32, 3))
    photograph = MIDDLE * gain * (image / MIDDLE) ** power
    assert psnr_exposed(image, photograph) > 100
    assert (psnr(image, photograph) < 40) == ((gain, power) != (1.0, 1.0))


@pytest.mark.parametrize("brightness", [0.0, 0.5, 1.0])
def test_plain_photographs_and_renders_give_finite_exposures(brightness):
    image = np.random.default_rng(0).uniform(0, 1, (16, 16, 3)).astype(np.float32)
    plain = np.full_like(image, brightness)
    for pair in ((image, plain), (plain, image), (plain, plain)):
        exposed = exposed_as(*pair)
        assert np.isfinite(exposed).all()
        assert exposed.min() >= 0
        assert exposed.max() <= 1


def test_an_exposure_never_takes_a_render_away_from_its_photograph():
    rng = np.random.default_rng(0)
    for spread in (0.0, 0.02, 0.1, 0.3):
        image = rng.uniform(0, 1, (24, 24, 3))
        photograph = (image + spread * rng.normal(size=image.shape)).clip(0, 1)
        assert psnr_exposed(image, photograph) >= psnr(image, photograph)
    assert psnr_exposed(image, image[::-1]) >= psnr(image, image[::-1])


def test_masked_pixels_have_no_say_in_the_exposure():
    rng = np.random.default_rng(0)
    image = rng.uniform(0.1, 0.7, (32, 32, 3))
    photograph = 0.8 * image
    counts = np.ones((32, 32), bool)
    counts[:, 16:] = False
    photograph[:, 16:] = rng.uniform(0, 1, (32, 16, 3))
    assert psnr_exposed(image, photograph, counts) > 100
    assert psnr_exposed(image, photograph) < 30
