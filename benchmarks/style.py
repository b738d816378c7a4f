"""What a style network costs and reaches: `python benchmarks/style.py --help`.

    style.py train mosaic udnie --weights VGG --transfer FOLDER --at 50 100 200
    style.py train mosaic --weights VGG --at 100 300 800
    style.py paint --size 504 378

Styles and content lie below `STYLETRF_DATA`; every eighth content image is held out. A row of JSON
is printed a measurement: the style and content terms on the held-out images (256 pixels square),
and how much the painting changes when the photograph moves (`temporal`, the mean squared difference
by its variance). Seconds are those of training alone.
"""

import argparse
import json
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import build_environment  # noqa: F401
import cv2
import torch

from pipeline.settings import data_root
from styletrf.capture.user_folders import find_style
from styletrf.configuration import configured
from styletrf.content.content_batches import content_batches, read_content
from styletrf.content.content_images import ContentConfig, write_content_images
from styletrf.content.content_sources import ContentSource, folder_source
from styletrf.files.images import read_rgb, write_rgb
from styletrf.style.perceptual.perceptual_loss import perceptual_loss, shrunk, style_grams
from styletrf.style.perceptual.vgg import VGG16, load_vgg
from styletrf.style.style_image import read_style_image
from styletrf.style.style_network import (
    PaintingNetwork,
    StyleNetwork,
    StyleNetworkConfig,
    save_style_network,
    stylize,
)
from styletrf.style.training.config import StyleTrainingConfig
from styletrf.style.training.step import StyleStep
from styletrf.style.training.temporal_loss import TemporalLossConfig, jittered_pair, temporal_loss
from styletrf.style.training.trainer import begin
from styletrf.style.transfer.network import TransferNetwork, TransferNetworkConfig
from styletrf.style.transfer.weights import load_style_transfer
from tasks.presets.presets import PRESETS, settings_for

HOLD_OUT_EVERY, HELD_OUT_PX = 8, 256


@dataclass(frozen=True)
class Settings:
    """Of the training."""

    training: StyleTrainingConfig = field(default_factory=StyleTrainingConfig)


@dataclass(frozen=True)
class Content:
    """The encoded images to train on, and those held out."""

    train: list[bytes]
    held_out: torch.Tensor  # images 3 256 256


def load_content(name: str) -> Content:
    """Returns the content set of this name, split."""
    source = folder_source(data_root() / "content" / name)
    held_out = source.names[::HOLD_OUT_EVERY]
    train = tuple(n for n in source.names if n not in held_out)
    with tempfile.TemporaryDirectory() as folder:
        chosen = ContentSource(source.subject, train, source.read)
        write_content_images(chosen, Path(folder), ContentConfig(count=len(train)))
        encoded = read_content(Path(folder))
    squares = [_square(data_root() / "content" / name / n) for n in held_out]
    return Content(encoded, torch.stack(squares))


def _square(path: Path) -> torch.Tensor:
    image = read_rgb(path)
    side = min(image.shape[:2])
    top, left = (n // 2 - side // 2 for n in image.shape[:2])
    crop = image[top : top + side, left : left + side]
    small = cv2.resize(crop, (HELD_OUT_PX, HELD_OUT_PX), interpolation=cv2.INTER_AREA)
    return torch.from_numpy(small).permute(2, 0, 1)


@torch.no_grad()
def held_out(
    network: PaintingNetwork, vgg: VGG16, grams: dict[str, torch.Tensor], images: torch.Tensor,
    config: StyleTrainingConfig,
) -> dict[str, float]:  # fmt: skip
    """Returns the mean terms of the loss, and the temporal loss under one disturbance."""
    rows = []
    for k, image in enumerate(images.split(1)):
        pair = jittered_pair(image, TemporalLossConfig(), torch.Generator().manual_seed(k))
        painted = network(image).clamp(0, 1)
        terms = perceptual_loss(vgg, painted, image, grams, config.loss)
        temporal = temporal_loss(painted, network(pair.second).clamp(0, 1), pair)
        rows.append(torch.stack([terms.style, terms.content, temporal]))
    style, content, temporal = torch.stack(rows).mean(dim=0).tolist()
    row = {"style": style, "content": content, "style_and_content": style + content}
    return row | {"temporal": temporal}


def trained(
    name: str,
    content: Content,
    vgg: VGG16,
    settings: Settings,
    at: list[int],
    out: Path | None,
    transfer: Path | None,
) -> Iterator[dict[str, Any]]:
    """Yields what a training has reached after each of the given iterations and at its end."""
    style = torch.from_numpy(read_style_image(find_style(data_root(), name)))
    loaded = load_style_transfer(transfer) if transfer else None
    initial = loaded.network_for(style) if loaded else None
    training, config = begin(settings.training, torch.device("cpu"), initial)
    step = StyleStep(config, vgg, style, initial, loaded.predictor if loaded else None)
    grams = style_grams(vgg, shrunk(style, config.style_px))
    batches = content_batches(
        content.train, batch=config.batch, size_px=config.crop_px, seed=config.seed
    )
    seconds = 0.0
    for k in range(config.iterations):
        started = time.monotonic()
        step(training, k, next(batches))
        seconds += time.monotonic() - started
        if k + 1 in (*at, config.iterations):
            losses = held_out(training.network, vgg, grams, content.held_out, config)
            yield {"style_image": name, "iteration": k + 1, "seconds": seconds} | losses
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        save_style_network(training.network, out)
        with torch.inference_mode():
            shown = training.network(content.held_out[:6]).clamp(0, 1)
        pairs = torch.cat([content.held_out[:6], shown], dim=-1)
        write_rgb(out / "held_out.png", torch.cat([*pairs], dim=1).permute(1, 2, 0).numpy())


def train(options: argparse.Namespace) -> None:
    """Prints what trainings reach."""
    values = {f"training.{k}": v for k, v in settings_for("StyleNetwork", options.quality).items()}
    for setting in options.set:
        name, _, value = setting.partition("=")
        values[name] = json.loads(value)
    settings = configured(Settings, values)
    content, vgg = load_content(options.content), load_vgg(options.weights)
    for name in options.styles:
        out = options.out / name if options.out else None
        for row in trained(name, content, vgg, settings, options.at, out, options.transfer):
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(json.dumps(row | {"peak_rss_mb": round(peak)}), flush=True)  # noqa: T201


def paint(options: argparse.Namespace) -> None:
    """Prints the seconds in which networks of both architectures paint an image."""
    width, height = options.size
    image = torch.rand(height, width, 3)
    networks: dict[str, PaintingNetwork] = {
        "transfer": TransferNetwork(TransferNetworkConfig()),
        "johnson": StyleNetwork(StyleNetworkConfig()),
    }
    for name, network in networks.items():
        seconds = []
        for _ in range(options.repeats):
            started = time.monotonic()
            stylize(network, image)
            seconds.append(time.monotonic() - started)
        seconds.sort()
        row = {"network": name, "best": seconds[0], "median": seconds[len(seconds) // 2]}
        print(json.dumps(row), flush=True)  # noqa: T201


def main() -> None:
    """Runs the mode that the command line names."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    modes = parser.add_subparsers(required=True)
    one = modes.add_parser("train", help=train.__doc__)
    one.add_argument("styles", nargs="+")
    one.add_argument("--weights", type=Path, required=True)
    one.add_argument("--content", default="coco128")
    one.add_argument("--quality", choices=PRESETS, default="draft")
    one.add_argument("--at", type=int, nargs="*", default=[])
    one.add_argument("--set", nargs="*", default=[], metavar="NAME=JSON")
    one.add_argument("--out", type=Path)
    one.add_argument("--transfer", type=Path, help="an artifact of TransferWeights to begin from")
    one.set_defaults(run=train)
    two = modes.add_parser("paint", help=paint.__doc__)
    two.add_argument("--size", type=int, nargs=2, default=(504, 378))
    two.add_argument("--repeats", type=int, default=7)
    two.set_defaults(run=paint)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
