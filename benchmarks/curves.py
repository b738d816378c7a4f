"""What an iteration costs against samples, rays, resolution, ranks and photographs.

    curves.py horns

One fresh process a point, so that its largest memory is its own; the lattice keeps its size and
every voxel counts as occupied but those known to be free. CPU time of one thread where
`NUMBA_NUM_THREADS=1 OMP_NUM_THREADS=1` are set.
"""

import argparse
import json
import resource
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

from field import settings_of, timed_steps, trainer_of
from given_scenes import load_given_scene

from styletrf.field.training.trainer import CURVE_EVERY

CURVES: dict[str, list[Any]] = {
    "training.steps_per_voxel": [0.175, 0.35, 0.7, 1.4],
    "training.batch": [512, 1024, 2048, 4096],
    "model.max_voxels": [112**3, 160**3, 224**3, 320**3],
    "training.field.density_ranks": [[4, 4, 4], [8, 8, 8], [16, 16, 16], [32, 32, 32]],
    "training.field.appearance_ranks": [[8, 8, 8], [16, 16, 16], [32, 32, 32], [64, 64, 64]],
    "photographs": [0.25, 0.5, 1.0],  # fraction of those that are fitted to
}


def point(scene: str, knob: str, value: Any) -> dict[str, Any]:
    """Returns what an iteration costs with one knob set."""
    changes = ["training.batch_samples=0", "training.upsample_at=[]"]
    if knob != "photographs":
        changes.append(f"{knob}={json.dumps(value)}")
    settings = settings_of(argparse.Namespace(quality="draft", seed=0, set=changes))
    given = load_given_scene(scene, settings.model)
    if knob == "photographs":
        few = round(value * len(given.train.cameras))
        part = replace(
            given.train, cameras=given.train.cameras[:few], images=given.train.images[:few]
        )
        given = replace(given, train=part)
    trainer = trainer_of(given, settings, None)
    timed = timed_steps(trainer, CURVE_EVERY)
    return {
        "scene": scene, "knob": knob, "value": value,
        "cpu_ms": timed["cpu_ms_per_iteration"],
        "density_samples": trainer.state.curve[-1].density_samples,
        "resolution": trainer.field.resolution,
        "photographs": len(given.train.cameras),
        "photographs_mb": sum(image.nbytes for image in given.train.images) / 2**20,
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }  # fmt: skip


def main() -> None:
    """Prints a row of JSON a point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="+")
    options = parser.parse_args()
    context = get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context, max_tasks_per_child=1) as processes:
        for scene in options.scenes:
            for knob, values in CURVES.items():
                for value in values:
                    row = processes.submit(point, scene, knob, value).result()
                    print(json.dumps(row), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
