"""Our modules against onnxruntime on the published files, at the sizes these are fixed to."""

from collections.abc import Mapping

import numpy as np
import onnxruntime
import pytest
import torch
from published_models import published_model, without_quantized_activations

from styletrf.content.procedural_images import procedural_image
from styletrf.style.transfer.network import conditioned
from styletrf.style.transfer.style_predictor import style_embedding
from styletrf.style.transfer.weights import (
    PACKAGE,
    StyleTransfer,
    build_transfer_weights,
    load_style_transfer,
)

CONTENT, PAINTING = (384, 256)
EMBEDDING = "mobilenet_conv/Conv/BiasAdd"


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> StyleTransfer:
    published_model("predict")  # skips without it
    folder = tmp_path_factory.mktemp("transfer")
    build_transfer_weights(PACKAGE, folder)
    return load_style_transfer(folder)


def image(side: int, seed: int) -> np.ndarray:
    return procedural_image(np.random.default_rng(seed), side, side).astype(np.float32) / 255


def run(content: bytes, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3  # errors: it would name every initializer that nothing uses
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    return session.run(None, dict(inputs))[0]


def predicted(content: bytes, painting: np.ndarray) -> np.ndarray:
    return run(content, {"style_image": painting[None]}).reshape(100)


def painted(content: bytes, image: np.ndarray, embedding: np.ndarray) -> np.ndarray:
    inputs = {"content_image": image[None], EMBEDDING: embedding.reshape(1, 1, 1, 100)}
    return run(content, inputs)[0]


def ours(transfer: StyleTransfer, image: np.ndarray, embedding: np.ndarray) -> np.ndarray:
    network = conditioned(transfer.network, transfer.conditioning, torch.from_numpy(embedding))
    with torch.no_grad():
        return network(torch.from_numpy(image).permute(2, 0, 1)[None])[0].permute(1, 2, 0).numpy()


def embedded(transfer: StyleTransfer, painting: np.ndarray) -> np.ndarray:
    return style_embedding(transfer.predictor, torch.from_numpy(painting)).numpy()


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(-10 * np.log10(np.square(a - b).mean()))


@pytest.mark.parametrize("seed", [0, 1])
def test_embedding_is_that_of_the_graph_without_quantized_activations(published, seed):
    exact = without_quantized_activations(published_model("predict"))
    painting = image(PAINTING, seed)
    found = embedded(published, painting)
    np.testing.assert_allclose(found, predicted(exact, painting), rtol=0, atol=1e-4)


@pytest.mark.parametrize("seed", [0, 1])
def test_painting_is_that_of_the_graph_without_quantized_activations(published, seed):
    exact = without_quantized_activations(published_model("transform"))
    content, embedding = image(CONTENT, seed + 2), embedded(published, image(PAINTING, seed))
    found = ours(published, content, embedding)
    np.testing.assert_allclose(found, painted(exact, content, embedding), rtol=0, atol=1e-4)


@pytest.mark.parametrize("seed", [0, 1])
def test_what_quantized_activations_change_is_small(published, seed):
    """The published graph rounds activations to 256 levels; ours does not."""
    content, painting = image(CONTENT, seed + 2), image(PAINTING, seed)
    embedding, theirs = (
        embedded(published, painting),
        predicted(published_model("predict"), painting),
    )
    assert np.corrcoef(embedding, theirs)[0, 1] > 0.999
    other = painted(published_model("transform"), content, embedding)
    assert psnr(ours(published, content, embedding), other) > 24
