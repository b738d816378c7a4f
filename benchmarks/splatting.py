"""The consistency protocol of Stylos and AnyStyle for folders of frames.

    splatting.py stylized=out/horns/mosaic/frames photographs=data/scenes/horns/images --width 504

A row of Markdown for each folder and gap, as `splatting_consistency` of
`styletrf.evaluation.consistency` has them. Frames are PNG, JPEG or EXR files in the order of their
names.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import cv2
import numpy as np

from styletrf.evaluation.consistency.splatting_consistency import splatting_consistency
from styletrf.evaluation.flow import FlowEstimator, Image, Method
from styletrf.files.float_images import read_float_image
from styletrf.files.images import read_rgb

SUFFIXES = {".png", ".jpg", ".jpeg", ".exr"}


def frames_in(folder: Path, width: int) -> Iterator[Image]:
    """Yields the frames of a folder, of one width in pixels."""
    for path in sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES):
        image = read_float_image(path).color if path.suffix == ".exr" else read_rgb(path)
        size = width, round(width * image.shape[0] / image.shape[1])
        resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        yield np.clip(resized, 0, 1).astype(np.float32)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", metavar="NAME=FOLDER")
    parser.add_argument("--width", type=int, default=504)
    parser.add_argument("--flow", choices=get_args(Method), default="dis")
    options = parser.parse_args()
    estimator = FlowEstimator(options.flow)
    print("| frames | gap | RMSE as published | where covered | covered | motion, px |")  # noqa: T201
    print("|---|---|---|---|---|---|")  # noqa: T201
    for name, folder in (pair.split("=", 1) for pair in options.folders):
        errors = splatting_consistency(frames_in(Path(folder), options.width), estimator)
        for gap, found in errors.items():
            cells = f"{found['rmse']:.4f} | {found['covered_rmse']:.4f}"
            covered = f"{found['covered_fraction']:.1%} | {found['motion_px']:.2f}"
            print(f"| {name} | {gap} | {cells} | {covered} |", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
