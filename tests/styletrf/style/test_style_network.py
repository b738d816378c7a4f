import json
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from expected_errors import rejects

from styletrf.style.style_network import (
    PaintingNetwork,
    StyleNetwork,
    StyleNetworkConfig,
    load_style_network,
    save_style_network,
    stylize,
)
from styletrf.style.transfer.network import TransferNetwork, TransferNetworkConfig

TINY = StyleNetworkConfig(width=4, n_residual=1)


def tiny(seed: int = 0) -> StyleNetwork:
    return StyleNetwork(TINY, torch.Generator().manual_seed(seed))


def test_the_default_network_has_as_many_parameters_as_johnsons():
    network = StyleNetwork(StyleNetworkConfig())
    assert sum(parameter.numel() for parameter in network.parameters()) == 1_679_235


def test_contrast_and_brightness_of_the_whole_image_do_not_matter():
    """What instance normalization buys (reflection padding keeps it exact up to its epsilon)."""
    network, image = tiny().double(), torch.rand(1, 3, 24, 24, dtype=torch.float64)
    other = 0.4 * image + 0.3
    torch.testing.assert_close(network(other), network(image), rtol=0, atol=1e-3)


def test_shift_by_the_stride_shifts_the_output_of_a_periodic_image():
    network = tiny().double()
    image = torch.rand(1, 3, 16, 16, dtype=torch.float64).tile(1, 1, 8, 8)
    output = network(image)
    inside, shifted = output[..., 48:64, 48:64], output[..., 52:68, 64:80]
    torch.testing.assert_close(shifted.roll(4, dims=-2), inside)


def test_stylize_clamps_and_keeps_the_size_without_gradient():
    network = tiny()
    with torch.no_grad():
        for parameter in network.decoder[-1].parameters():
            parameter.mul_(1000)
    painted = stylize(network, torch.rand(21, 30, 3))
    assert painted.shape == (21, 30, 3)
    assert painted.min() == 0
    assert painted.max() == 1
    assert not painted.requires_grad


def transfer() -> TransferNetwork:
    config = TransferNetworkConfig(widths=(2, 3, 4), n_residual=1)
    return TransferNetwork(config, torch.Generator().manual_seed(0))


@pytest.mark.parametrize("made", [tiny, transfer])
def test_a_network_comes_back_from_its_files_bit_for_bit(
    tmp_path: Path, made: Callable[[], PaintingNetwork]
):
    network, image = made(), torch.rand(1, 3, 16, 16)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        save_style_network(network, tmp_path / name)
    loaded = load_style_network(tmp_path / "a")
    assert type(loaded) is type(network)
    assert loaded.config == network.config
    assert torch.equal(loaded(image), network(image))
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def test_files_that_name_no_architecture_are_johnsons(tmp_path: Path):
    save_style_network(tiny(), tmp_path)
    (tmp_path / "style_network.json").write_text('{"n_residual": 1, "width": 4}')
    assert load_style_network(tmp_path).config == TINY


@pytest.mark.parametrize(
    "config",
    ["", "[]", "null", '{"width": 8}', '{"depth": 3}', '{"width": 0}', '{"architecture": "vgg"}'],
)
def test_damaged_files_are_an_input_error(tmp_path: Path, config: str):
    save_style_network(tiny(), tmp_path)
    (tmp_path / "style_network.json").write_text(config)
    with rejects(tmp_path):
        load_style_network(tmp_path)


@pytest.mark.parametrize(
    "size", ["{}", '{"widths": [2, 3]}', '{"widths": [2, 3, 5]}', '{"widths": 3}']
)
def test_damaged_files_of_a_transfer_network_are_an_input_error(tmp_path: Path, size: str):
    save_style_network(transfer(), tmp_path)
    config = {"architecture": "transfer", "n_residual": 1, **json.loads(size)}
    (tmp_path / "style_network.json").write_text(json.dumps(config))
    with rejects(tmp_path):
        load_style_network(tmp_path)


def test_absent_files_are_an_input_error(tmp_path: Path):
    with rejects(tmp_path):
        load_style_network(tmp_path)
