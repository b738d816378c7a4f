from pathlib import Path

import pytest
import torch
from expected_errors import rejects
from safetensors.torch import save_file

from styletrf.style.perceptual.vgg import CONVOLUTIONS, LAYERS, VGG16, load_vgg


def random_vgg(seed: int = 0) -> VGG16:
    vgg = VGG16()
    generator = torch.Generator().manual_seed(seed)
    for parameter in vgg.parameters():
        torch.nn.init.normal_(parameter, std=(2 / parameter[0].numel()) ** 0.5, generator=generator)
    return vgg.requires_grad_(requires_grad=False)


def test_layers_have_the_channels_and_the_grid_of_the_paper():
    found = random_vgg().features(torch.rand(2, 3, 37, 50), LAYERS)
    assert list(found) == list(LAYERS)
    for layer, features in found.items():
        poolings = int(layer[4]) - 1
        channels = CONVOLUTIONS[layer.replace("relu", "conv")][1]
        assert features.shape == (2, channels, 37 >> poolings, 50 >> poolings)
        assert (features >= 0).all()


def test_features_do_not_depend_on_what_else_is_asked_for():
    vgg, images = random_vgg(), torch.rand(1, 3, 16, 16)
    alone = vgg.features(images, ["relu2_2"])
    assert list(alone) == ["relu2_2"]
    assert torch.equal(alone["relu2_2"], vgg.features(images, LAYERS)["relu2_2"])


def test_nothing_is_computed_beyond_the_deepest_layer_asked_for():
    vgg = random_vgg()
    reached = []
    for name in CONVOLUTIONS:
        hook = lambda *_, name=name: reached.append(name)  # noqa: E731
        vgg.get_submodule(name).register_forward_hook(hook)
    vgg.features(torch.rand(1, 3, 8, 8), ["relu1_2", "relu2_1"])
    assert reached == ["conv1_1", "conv1_2", "conv2_1"]


def test_borders_are_padded_with_the_mean_color():
    vgg = random_vgg()
    vgg.mean.copy_(torch.tensor([0.5, 0.4, 0.3]))
    vgg.std.copy_(torch.tensor([0.2, 0.25, 0.3]))
    image = torch.rand(1, 3, 8, 8)
    framed = vgg.mean[None, :, None, None].expand(1, 3, 10, 10).clone()
    framed[..., 1:-1, 1:-1] = image
    inner = vgg.features(framed, ["relu1_1"])["relu1_1"][..., 1:-1, 1:-1]
    torch.testing.assert_close(vgg.features(image, ["relu1_1"])["relu1_1"], inner)


def test_gradient_reaches_the_image_and_not_the_weights():
    vgg, image = random_vgg(), torch.rand(1, 3, 16, 16, requires_grad=True)
    vgg.features(image, ["relu4_3"])["relu4_3"].sum().backward()
    assert image.grad is not None
    assert image.grad.abs().sum() > 0
    assert all(parameter.grad is None for parameter in vgg.parameters())


def test_bfloat16_weights_give_nearly_the_same_features():
    images = torch.rand(1, 3, 32, 32)
    exact = random_vgg().features(images, ["relu3_3"])["relu3_3"]
    fast = random_vgg().to(torch.bfloat16).features(images, ["relu3_3"])["relu3_3"]
    assert fast.dtype == torch.bfloat16
    assert (fast.float() - exact).norm() < 0.03 * exact.norm()


def test_unknown_layer_is_refused():
    with pytest.raises(ValueError, match="relu5_1"):
        random_vgg().features(torch.rand(1, 3, 8, 8), ["relu5_1"])


def test_weights_survive_the_file_and_are_frozen(tmp_path: Path):
    vgg = random_vgg()
    save_file(vgg.state_dict(), tmp_path / "vgg16.safetensors")
    loaded = load_vgg(tmp_path / "vgg16.safetensors")
    assert all(
        torch.equal(a, b) for a, b in zip(vgg.parameters(), loaded.parameters(), strict=True)
    )
    assert not any(parameter.requires_grad for parameter in loaded.parameters())


@pytest.mark.parametrize("content", [None, b"", b"no tensors"])
def test_damaged_weights_are_an_input_error(tmp_path: Path, content: bytes | None):
    path = tmp_path / "vgg16.safetensors"
    if content is not None:
        path.write_bytes(content)
    with rejects(path):
        load_vgg(path)


def test_other_tensors_are_an_input_error(tmp_path: Path):
    save_file({"weight": torch.zeros(1)}, tmp_path / "vgg16.safetensors")
    with rejects(tmp_path / "vgg16.safetensors", "VGG16"):
        load_vgg(tmp_path / "vgg16.safetensors")
