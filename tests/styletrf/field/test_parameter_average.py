"""The running mean of parameters: closed forms, and what it is for."""

import pytest
import torch
from torch import nn

from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.parameter_average import ParameterAverage


def averaged(values: list[torch.Tensor], window: float) -> torch.Tensor:
    """Returns the average after all values of one parameter."""
    module = nn.ParameterDict({"p": nn.Parameter(torch.full_like(values[0], torch.nan))})
    average = ParameterAverage(float(window))
    for value in values:
        module["p"].data.copy_(value)
        average.add(module)
    average.copy_to(module)
    return module["p"].data


def draws(count: int, size: int = 3) -> list[torch.Tensor]:
    return list(torch.randn(count, size, generator=torch.Generator().manual_seed(1)).double())


@pytest.mark.parametrize("window", [7, 7.5, 100])
def test_up_to_the_window_the_average_is_the_plain_mean(window):
    values = draws(7)
    torch.testing.assert_close(averaged(values, window), torch.stack(values).mean(dim=0))


def test_beyond_the_window_values_fade_exponentially():
    values, window = draws(40), 5
    expected = torch.stack(values[:window]).mean(dim=0)
    for value in values[window:]:
        expected = (1 - 1 / window) * expected + value / window
    torch.testing.assert_close(averaged(values, window), expected)


@pytest.mark.parametrize("window", [0, 0.3, 1])
def test_a_window_of_at_most_one_keeps_the_last_value(window):
    values = draws(5)
    assert torch.equal(averaged(values, window), values[-1])


def test_without_values_the_parameters_stay():
    module = nn.Linear(2, 2)
    before = {name: value.detach().clone() for name, value in module.named_parameters()}
    ParameterAverage(3.0).copy_to(module)
    for name, value in module.named_parameters():
        assert torch.equal(value, before[name])


def test_a_large_constant_stays_itself():
    """The difference to the mean is zero, however many values there are."""
    constant = torch.full((3,), 1e30)
    assert torch.equal(averaged([constant] * 50, 7), constant)


def test_noisy_steps_end_farther_from_the_minimum_than_their_average():
    """Gradient descent on |x|^2 / 2 with noise of variance 1 and rate r: E x^2 = r / (2 - r)."""
    generator = torch.Generator().manual_seed(0)
    x, values = torch.zeros(200), []
    for _ in range(2000):
        x = x - 0.5 * (x + torch.randn(200, generator=generator))
        values.append(x)
    assert values[-1].square().mean() == pytest.approx(1 / 3, rel=0.3)
    assert averaged(values, 500).square().mean() < 0.02


@pytest.mark.parametrize(
    ("iterations", "every", "window"),
    [(9, 1, 0.9), (150, 1, 15), (500, 5, 10), (5000, 10, 50), (30000, 10, 300)],
)
def test_values_are_taken_often_enough_for_ten_in_a_window(iterations, every, window):
    config = FieldTrainingConfig(iterations=iterations, average_share=0.1)
    assert config.average_every == every
    assert config.average_window == pytest.approx(window)


@pytest.mark.parametrize("fraction", [-0.1, 1.5, float("nan")])
def test_the_share_lies_between_zero_and_one(fraction):
    with pytest.raises(ValueError, match="average_share"):
        FieldTrainingConfig(average_share=fraction)
