"""The base network is whole, and a training from it begins ahead of one from random weights."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from test_style_training import TINY, content  # noqa: F401

from styletrf.base_network import BASE_NETWORKS, base_network
from styletrf.base_network_training import a_style, train_base_network
from styletrf.style_network import StyleNetworkConfig
from styletrf.style_training import begin


@pytest.mark.parametrize("config", BASE_NETWORKS)
def test_each_base_network_paints_finite_pictures(config):
    network = base_network(config)
    assert network is not None
    image = network(torch.rand(1, 3, 40, 52))
    assert torch.isfinite(image).all()
    assert image.std() > 0.02


def test_there_is_none_of_other_sizes():
    assert base_network(StyleNetworkConfig(5, 1)) is None


def test_a_training_begins_from_the_base_without_learning_to_repeat():
    size = next(iter(BASE_NETWORKS))
    for warm, identity in ((True, 0), (False, TINY.identity_iterations)):
        training, config = begin(replace(TINY, network=size, warm_start=warm), torch.device("cpu"))
        assert config.identity_iterations == identity
        same = torch.equal(training.network.encoder[1].weight, base_network(size).encoder[1].weight)
        assert same == warm


def test_styles_to_learn_from_are_pictures_and_never_twice_the_same():
    generator = np.random.default_rng(0)
    styles = [a_style(generator) for _ in range(6)]
    for image, scale in styles:
        assert image.shape == (512, 512, 3)
        assert 0 <= image.min() < image.max() <= 1
        assert 0.5 < scale < 1.5
    assert len({float(image.mean()) for image, _ in styles}) == 6


def test_the_base_goes_the_share_of_the_way_and_the_same_way_each_time(vgg, content):  # noqa: F811
    config = replace(TINY, iterations=8, identity_iterations=0, crop_px=32)
    fresh, _ = begin(config, torch.device("cpu"))

    def base(share: float) -> torch.Tensor:
        network = train_base_network(config, vgg, content, inner=8, share=share)
        return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])

    start = torch.cat([p.detach().flatten() for p in fresh.network.parameters()])
    whole, half = base(1.0), base(0.5)
    assert torch.equal(base(0.0), start)
    torch.testing.assert_close(half, (start + whole) / 2, atol=1e-6, rtol=1e-4)
    assert (whole - start).abs().max() > 1e-3
    assert torch.equal(base(0.5), half)
