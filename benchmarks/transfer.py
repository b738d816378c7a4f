"""What de-quantizing the published weights of arbitrary style transfer changes, and what they cost.

    transfer.py PHOTOGRAPH PAINTING...

Prints a row of Markdown for each painting: the correlation of its embedding with that of
onnxruntime on the published int8 graph, the PSNR of the photograph painted by both at 384x384, the
same after the activations' quantization is removed from the graph, and seconds at 504 pixels.
Needs the packages for development.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
import torch

from styletrf.files.images import read_rgb
from styletrf.files.packaged_weights import read_packaged
from styletrf.style.style_network import stylize
from styletrf.style.transfer.network import conditioned
from styletrf.style.transfer.style_predictor import style_embedding
from styletrf.style.transfer.weights import (
    PACKAGE,
    PREDICT,
    TRANSFORM,
    StyleTransfer,
    build_transfer_weights,
    load_style_transfer,
)

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/support"))
from published_models import without_quantized_activations  # type: ignore[import-not-found]

_LONG_SIDE_PX = 504


def resized(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Returns an image of this size, low-pass filtered."""
    return np.clip(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), 0, 1)


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """Returns the peak signal-to-noise ratio in dB."""
    return float(-10 * np.log10(np.square(a - b).mean()))


def run(content: bytes, *inputs: np.ndarray) -> np.ndarray:
    """Returns what onnxruntime computes."""
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3  # errors: it would name every initializer that nothing uses
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    names = [item.name for item in session.get_inputs()]
    return np.asarray(session.run(None, dict(zip(names, inputs, strict=True)))[0])


def row(transfer: StyleTransfer, photograph: np.ndarray, painting: np.ndarray) -> list[str]:
    """Returns the figures of one painting."""
    square = torch.from_numpy(resized(painting, 256, 256))
    embedding = style_embedding(transfer.predictor, square)
    theirs = run(read_packaged(PREDICT), square.numpy()[None]).reshape(100)
    correlation = np.corrcoef(embedding.numpy(), theirs)[0, 1]
    network = conditioned(transfer.network, transfer.conditioning, embedding)
    small = resized(photograph, 384, 384)
    with torch.no_grad():
        ours = network(torch.from_numpy(small).permute(2, 0, 1)[None])[0].permute(1, 2, 0).numpy()
    inputs = small[None], embedding.numpy().reshape(1, 1, 1, 100)
    published = read_packaged(TRANSFORM)
    rounded, exact = (
        run(graph, *inputs)[0] for graph in (published, without_quantized_activations(published))
    )
    height, width = photograph.shape[:2]
    scale = _LONG_SIDE_PX / max(height, width)
    view = torch.from_numpy(resized(photograph, round(width * scale), round(height * scale)))
    stylize(network, view)
    begin = time.perf_counter()
    stylize(transfer.network_for(torch.from_numpy(painting)), view)
    seconds = time.perf_counter() - begin
    return [
        f"{correlation:.5f}", f"{psnr(ours, rounded):.1f} dB", f"{np.abs(ours - exact).max():.1e}",
        f"{seconds:.2f}",
    ]  # fmt: skip


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photograph", type=Path)
    parser.add_argument("paintings", type=Path, nargs="+")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        build_transfer_weights(PACKAGE, Path(folder))
        transfer = load_style_transfer(Path(folder))
    print("| painting | embedding | PSNR | largest difference without it | seconds |")  # noqa: T201
    print("|---|---|---|---|---|")  # noqa: T201
    for path in given.paintings:
        figures = row(transfer, read_rgb(given.photograph), read_rgb(path))
        print("| " + " | ".join([path.stem, *figures]) + " |")  # noqa: T201


if __name__ == "__main__":
    main()
