"""Every backend of the kernels as one fixture.

Triton's kernels run on the GPU; where there is none, in Triton's interpreter, which is chosen
before Triton is first imported.
"""

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch

from styletrf.style.perceptual.vgg import VGG16

HAS_GPU = torch.cuda.is_available()
if not HAS_GPU:
    os.environ.setdefault("TRITON_INTERPRET", "1")


@pytest.fixture(autouse=True, scope="session")
def _daylight(_shared: None) -> Iterator[None]:
    """Workers share the light of the courtyard."""
    from shared_daylight import shared_daylight  # not before its shapes are checked

    with shared_daylight():
        yield


@pytest.fixture(params=["reference", "fused", "triton"])
def backend(request: pytest.FixtureRequest) -> Iterator[Any]:
    """Each backend in turn; within the test new tensors are made on the device it runs on."""
    from styletrf.field.kernels import kernels_for  # not before its shapes are checked

    if request.param == "triton":
        pytest.importorskip("triton", reason="Triton is not installed (extra gpu)")
    device = torch.device("cuda" if HAS_GPU and request.param == "triton" else "cpu")
    with device, np.errstate(all="ignore"):  # numpy warns of overflow where a card does not
        yield kernels_for(device, request.param)


@pytest.fixture(scope="module")
def scene() -> Any:
    """A painted plane and its photographs: `mini_scene.MiniScene`."""
    from mini_scene import painted_plane  # not before its shapes are checked

    return painted_plane()


@pytest.fixture(scope="module")
def vgg() -> VGG16:
    """A perceptual network with random weights, always the same."""
    network = VGG16().requires_grad_(requires_grad=False)
    generator = torch.Generator().manual_seed(0)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=(2 / parameter[0].numel()) ** 0.5, generator=generator)
    return network


@pytest.fixture(scope="session", params=["published", "random"])
def transfer(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Arbitrary style transfer with the published weights, where they are, and with random ones."""
    from onnx_files import write_transfer_files
    from published_models import published_model

    from styletrf.style.transfer.weights import PACKAGE, build_transfer_weights, load_style_transfer

    folder, source = tmp_path_factory.mktemp("transfer"), PACKAGE
    if request.param == "published":
        published_model("predict")  # skips without it
    else:
        source = str(write_transfer_files(tmp_path_factory.mktemp("onnx")))
    build_transfer_weights(source, folder)
    return load_style_transfer(folder)
