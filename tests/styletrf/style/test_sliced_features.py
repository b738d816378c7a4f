"""The sliced Wasserstein distance of features: closed forms, and what Gram matrices cannot tell."""

import pytest
import torch

from styletrf.style.perceptual.perceptual_loss import STYLE_LAYERS, gram_matrix
from styletrf.style.perceptual.sliced_features import sliced_term, sliced_wasserstein, style_columns


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def rows(n: int, channels: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(n, channels, generator=generator(seed), dtype=torch.float64)


def test_equal_samples_have_no_distance_in_any_order():
    samples = rows(100, 5)
    shuffled = samples[torch.randperm(100, generator=generator())]
    assert float(sliced_wasserstein(samples, shuffled, generator())) < 1e-20


def test_a_shift_has_the_distance_of_its_projections():
    """E (v . t)^2 = |t|^2 / d over unit vectors v in d dimensions."""
    samples, shift = rows(64, 4), torch.tensor([1.0, -2.0, 0.5, 3.0], dtype=torch.float64)
    found = sliced_wasserstein(samples, samples + shift, generator(), projections=20_000)
    torch.testing.assert_close(found, shift.square().sum() / 4, rtol=0.03, atol=0)


def test_samples_of_different_numbers_are_compared_by_quantiles():
    line = torch.linspace(0, 1, 1000, dtype=torch.float64)[:, None]
    assert float(sliced_wasserstein(line[::10], line, generator())) < 1e-4


def test_distributions_of_one_gram_matrix_are_distinguished():
    """Signs alone and a normal distribution have the same second moments."""
    signs = rows(4096, 3).sign()
    normal = rows(4096, 3, seed=1)
    normal = normal / normal.square().mean(dim=0).sqrt()
    grams = [gram_matrix(r.T[None, :, :, None]) for r in (signs, normal)]
    assert (grams[0] - grams[1]).abs().max() < 0.1 * grams[0].abs().max()
    assert float(sliced_wasserstein(signs, normal, generator())) > 0.01


def test_gradients_are_those_of_finite_differences():
    target = rows(12, 3, seed=1)

    def distance(samples: torch.Tensor) -> torch.Tensor:
        return sliced_wasserstein(samples, target, generator(), projections=4)

    assert torch.autograd.gradcheck(distance, rows(12, 3).requires_grad_())


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_flat_paintings_have_finite_gradients(vgg, value):
    columns = style_columns(vgg, torch.full((1, 3, 32, 32), value))
    output = torch.rand(1, 3, 32, 32, generator=generator()).requires_grad_()
    term = sliced_term(
        columns, dict.fromkeys(STYLE_LAYERS, 1.0), generator(), vgg.features(output, STYLE_LAYERS)
    )
    term.backward()
    assert torch.isfinite(term)
    assert output.grad is not None
    assert torch.isfinite(output.grad).all()


def test_the_painting_itself_is_nearest(vgg):
    painting = torch.rand(1, 3, 40, 40, generator=generator())
    columns = style_columns(vgg, painting)
    terms = [
        float(
            sliced_term(
                columns,
                dict.fromkeys(STYLE_LAYERS, 1.0),
                generator(2),
                vgg.features(i, STYLE_LAYERS),
            )
        )
        for i in (painting, 0.5 * painting)
    ]
    assert terms[0] < 1e-6 < terms[1]
