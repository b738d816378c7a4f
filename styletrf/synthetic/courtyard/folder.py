"""A capture as files: `images/000.png`, ... as photographs, and beside them `truth/`.

`truth/` holds `cameras.parquet`, `depth/000.npy`, ... (float32 Z in meters, infinite in the sky)
and `capture.json`, the configuration. Nothing in `images/` contains a pose.
"""

import json
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from styletrf.errors import InputError
from styletrf.geometry.camera_table import write_cameras
from styletrf.progress import Progress, silent
from styletrf.synthetic.courtyard.capture import Capture, CourtyardConfig, capture_courtyard


def write_courtyard(folder: Path, config: CourtyardConfig, progress: Progress = silent) -> bool:
    """Makes a capture in `folder`, or returns False where it is there already.

    All files are written aside and moved in place at the end, `images` last, so that a run that is
    killed leaves no `images`.

    Raises:
        InputError: The folder holds other images, or the configuration makes no sense.
    """
    if (folder / "images").exists():
        _check_same(folder, config)
        return False
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".courtyard-", dir=folder) as aside:
        _write(Path(aside), config, capture_courtyard(config, progress))
        if (folder / "truth").exists():  # of a run killed between the two moves
            (folder / "truth").rename(Path(aside) / "abandoned")
        (Path(aside) / "truth").rename(folder / "truth")
        (Path(aside) / "images").rename(folder / "images")
    return True


def _check_same(folder: Path, config: CourtyardConfig) -> None:
    record = folder / "truth" / "capture.json"
    if not record.exists() or json.loads(record.read_text()) != asdict(config):
        raise InputError(
            str(folder / "images"),
            "holds other images than the courtyard asked for",
            "Name another folder, or remove this one",
        )


def _write(folder: Path, config: CourtyardConfig, capture: Capture) -> None:
    images, truth = folder / "images", folder / "truth"
    for made in (images, truth / "depth"):
        made.mkdir(parents=True)
    views = zip(capture.cameras, capture.images, capture.depths, strict=True)
    for camera, image, depth in views:
        _, encoded = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        (images / camera.name).write_bytes(encoded.tobytes())
        np.save(truth / "depth" / f"{Path(camera.name).stem}.npy", depth)
    write_cameras(truth / "cameras.parquet", capture.cameras)
    (truth / "capture.json").write_text(json.dumps(asdict(config), indent=1, sort_keys=True))
