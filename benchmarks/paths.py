"""What photographs support of camera paths: `paths.py --scenes horns fern --quality draft`.

A row a scene and path: the fraction of the pixels that fewer than three fitted photographs see, and
the largest fraction of a frame, for the default path as TrajectoryFrames has it and for every named
one; and for the photographs held out, at their own places. Fields that are missing are fitted.
"""

import argparse
import json
from collections.abc import Iterator

import luigi
import torch
from task_of import task_of

from pipeline.task import artifact
from styletrf.field.radiance_field import load_field
from styletrf.geometry.camera_table import read_cameras, read_split
from styletrf.scene.scene_model import read_scene_model
from styletrf.trajectory.chosen_path import chosen_path
from styletrf.trajectory.frames import FramesConfig
from styletrf.trajectory.support import Support, SupportMeter
from styletrf.trajectory.supported_path import supported_fly_through
from tasks.stages.field import RadianceField

NAMES = ("orbit", "spiral", "dolly", "photographs")


def supports(field: RadianceField) -> Iterator[tuple[str, Support]]:
    """Yields the paths of a scene and their support."""
    poses, scene = (artifact(field.requires()[name]) for name in ("poses", "model"))
    model, config = read_scene_model(scene / "scene.json"), FramesConfig()
    cameras = model.normalized(read_cameras(poses / "cameras.parquet"))
    fitted, held_out = map(model.normalized, read_split(poses / "cameras.parquet"))
    radiance, device = load_field(artifact(field)), torch.device("cpu")
    folder = None if model.exposures else poses / "images"
    meter = SupportMeter(fitted, radiance, model.space, config.support, device, folder)
    path = supported_fly_through(cameras, model, config.trajectory, meter.measure, config.support)
    for trial in path.trials:
        yield f"auto {trial.spread:.2g}, x {trial.zoom:g}", Support({"": trial.unsupported})
    yield "auto", path.support
    for name in NAMES:
        yield name, meter.measure(chosen_path(name, cameras, model, config, are_given=False))
    yield "photographs held out", meter.measure(held_out)


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", required=True)
    parser.add_argument("--quality", default="draft")
    parser.add_argument("--tuning", type=json.loads, default={})
    options = parser.parse_args()
    for scene in options.scenes:
        field = task_of(RadianceField, scene=scene, quality=options.quality, tuning=options.tuning)
        luigi.build([field], local_scheduler=True)
        for name, support in supports(field):
            worst = max(support.unsupported.values())
            print(f"{scene:10} {name:24} {support.fraction:7.2%} worst frame {worst:7.2%}")  # noqa: T201


if __name__ == "__main__":
    main()
