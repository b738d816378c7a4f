"""The paper's comparison of painters: how alike do they paint neighboring views of a scene?

    painters.py courtyard --style stained_glass --views 6 --quality draft

Views evenly along the path are painted by each painter (StylizedPriors), and neighbors are compared
along the field's depth, as ConsistencyMetrics compares frames. A row of Markdown for each painter:
the error by contrast and its floor, that of the plain renders; the distance to the painting by Gram
matrices and that of the plain renders; seconds a view.
"""

import argparse
import json
from typing import Any

import luigi
import torch
from task_of import task_of

from pipeline.task import artifact
from styletrf.evaluation.consistency.frame_pairs import read_frame
from styletrf.evaluation.consistency.trajectory_consistency import (
    ConsistencyConfig,
    measure_consistency,
)
from styletrf.evaluation.perceptual_distance import PerceptualFeatures
from styletrf.files.images import read_rgb
from styletrf.geometry.camera_table import read_cameras
from styletrf.style.perceptual.vgg import load_vgg
from tasks.stages.stylization import StylizedPriors
from tasks.stages.weights import PerceptualWeights

PAINTERS: dict[str, tuple[str, dict[str, Any]]] = {
    "`johnson`": ("johnson", {}),
    "`arbitrary`": ("arbitrary", {}),
    "`gatys` from the network's picture": ("gatys", {"start": "network"}),
    "`gatys` from noise": ("gatys", {"start": "noise", "iterations": [300, 100]}),
}


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene")
    parser.add_argument("--style", required=True)
    parser.add_argument("--views", type=int, default=6)
    parser.add_argument("--quality", default="draft")
    parser.add_argument("--tuning", type=json.loads, default={})
    options = parser.parse_args()
    views = {"viewpoints": "path", "trajectory.frames": options.views}
    tuning = {**options.tuning, "PriorRenders": {**views, "coverage.count": options.views}}
    print("| painter | error by contrast (floor) | style distance (plain) | s a view |")  # noqa: T201
    print("|---|---|---|---|")  # noqa: T201
    for name, (stylizer, settings) in PAINTERS.items():
        task = task_of(
            StylizedPriors,
            scene=options.scene,
            style=options.style,
            quality=options.quality,
            stylizer=stylizer,
            tuning={**tuning, "StylizedPriors": settings},
        )
        wanted = [task, task.upstream(PerceptualWeights)]
        if not luigi.build(wanted, local_scheduler=True, log_level="WARNING"):
            raise SystemExit(f"{task} failed")
        print(f"| {name} | {_row(task, options.views)} |", flush=True)  # noqa: T201


def _row(task: StylizedPriors, count: int) -> str:
    needed = task.requires()
    priors, painted = artifact(needed["priors"]), artifact(task)
    weights = artifact(task.upstream(PerceptualWeights)) / "vgg16.safetensors"
    vgg = load_vgg(weights, torch.device("cpu"))
    config = ConsistencyConfig(deltas=(1,), depth_deltas=())
    cameras = read_cameras(priors / "cameras.parquet")
    found = measure_consistency(
        (read_frame(priors, painted, camera) for camera in cameras),
        len(cameras),
        read_rgb(artifact(needed["style"]) / "style.png"),
        PerceptualFeatures(vgg, config.perceptual_px),
        config,
    ).summary["delta_1"]
    record = task.record()
    seconds = float(str(record.provenance["seconds"])) / count if record else float("nan")
    error = f"{found['normalized_error']:.3f} ({found['normalized_floor']:.3f})"
    style = f"{found['style_distance']:.2f} ({found['style_distance_unstylized']:.2f})"
    return f"{error} | {style} | {seconds:.1f}"


if __name__ == "__main__":
    main()
