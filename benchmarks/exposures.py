"""What exposures that change do to a field, and what taking them out gives back.

The photographs of a scene are shown through gains and powers of their own, drawn by a seed, cut off
at white and rounded to 8 bits; the poses are those of the scene as it is. A field is fitted to them
with one exposure for all (`one`), or with each photograph's own (`each`). It is judged by the
photographs held out, as it is (psnr) and once it is exposed as they are (psnr_exposed), and by how
much neighboring frames of its fly-through differ along its own geometry.

    exposures.py evidence fern horns fox
    exposures.py fit fern --exposure 0.2 --white-balance 0.2 --power 0.2 --iterations 1200
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import cv2
import luigi
import numpy as np
import torch
from task_of import task_of

from pipeline.task import artifact
from styletrf.evaluation.consistency.geometric_consistency import corresponding, geometric_errors
from styletrf.evaluation.exposed_image import psnr_exposed
from styletrf.evaluation.metrics import Image, psnr
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.observed_depths import observed_depths
from styletrf.field.training.view_exposures import view_exposures
from styletrf.files.images import from_integers, read_rgb, to_integers
from styletrf.geometry.camera_table import read_cameras, read_fitted_rows
from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints, read_points
from styletrf.scene.exposure_choice import (
    ExposureEvidence,
    exposure_evidence,
    taken_by_several,
)
from styletrf.scene.exposures import MIDDLE
from styletrf.scene.free_space import free_space
from styletrf.scene.observed_colors import observed_colors
from styletrf.scene.scene_model import SceneModel, SceneModelConfig, decide_scene_model
from styletrf.scene.training_photographs import read_training_photographs
from styletrf.scene.view_dependence import ViewDependence, view_dependence
from styletrf.trajectory.frames import rendered
from styletrf.trajectory.trajectories import fly_through
from styletrf.trajectory.trajectory_config import TrajectoryConfig
from tasks.stages.scene import CameraPoses

CPU = torch.device("cpu")


@dataclass(frozen=True)
class Changes:
    """The greatest change of log gain by exposure and white balance, of log power, and the seed."""

    exposure: float = 0.0
    white_balance: float = 0.0
    power: float = 0.0
    seed: int = 1

    def applied(self, images: Sequence[Image]) -> Iterator[Image]:
        """Yields the images through gains and powers drawn uniformly."""
        rng = np.random.default_rng(self.seed)
        for image in images:
            log_gain = rng.uniform(-self.exposure, self.exposure) + rng.uniform(
                -self.white_balance, self.white_balance, 3
            )
            power = np.exp(rng.uniform(-self.power, self.power))
            shown = MIDDLE * np.exp(log_gain) * (image / MIDDLE) ** power
            yield from_integers(to_integers(shown.clip(0, 1).astype(np.float32)))


@dataclass(frozen=True)
class Photographs:
    """A scene's photographs with their cameras; the rows that are fitted, and those held out."""

    cameras: list[Camera]
    images: list[Image]
    points: SparsePoints
    fitted: list[int]
    several_cameras: bool

    @property
    def held_out(self) -> list[int]:
        """The rows that only measure."""
        return [k for k in range(len(self.cameras)) if k not in self.fitted]


def photographs_of(name: str, changes: Changes) -> Photographs:
    """Returns a scene's photographs, changed; its poses are taken from the store or made there."""
    poses = task_of(CameraPoses, scene=name, quality="draft")
    if not luigi.build([poses], local_scheduler=True, log_level="WARNING"):
        raise SystemExit(f"{name} has no poses")
    folder = artifact(poses)
    cameras = read_cameras(folder / "cameras.parquet")
    images = [read_rgb(folder / "images" / f"{camera.name}.png") for camera in cameras]
    points = read_points(folder / "points.parquet")
    fitted = read_fitted_rows(folder / "cameras.parquet")
    changed = list(changes.applied(images))
    several_cameras = taken_by_several(read_training_photographs(folder).long_sides_px)
    return Photographs(cameras, changed, points, fitted, several_cameras)


def evidence_of(photographs: Photographs) -> tuple[ExposureEvidence, ViewDependence]:
    """Returns what the scene's model is decided from."""
    fitted, points = photographs.fitted, photographs.points.of_images(photographs.fitted)
    cameras = [photographs.cameras[k] for k in fitted]
    observed = observed_colors([photographs.images[k] for k in fitted], points)
    exposure = exposure_evidence(
        points, observed.log_color, cameras, several_cameras=photographs.several_cameras
    )
    return exposure, view_dependence(observed, points, cameras)


def frame_rms(field: RadianceField, model: SceneModel, cameras: list[Camera]) -> float:
    """Returns the root mean square difference of neighboring frames along the geometry."""
    path = fly_through(cameras, model, TrajectoryConfig(frames=24))
    frames = list(rendered(field, model.space, path, RenderConfig(), CPU))
    errors = []
    for (a, of_a), (b, of_b) in pairwise(zip(path, frames, strict=True)):
        depths = of_a.surface_depth.numpy(), of_b.surface_depth.numpy()
        seen = corresponding((a, b), depths, of_b.color.numpy(), of_b.color.numpy(), 0.02)
        errors.append(
            geometric_errors(of_a.color.numpy(), of_a.color.numpy(), seen).geometric_floor
        )
    return float(np.sqrt(np.nanmean(errors)))


def fit(
    photographs: Photographs, exposure: Literal["auto", "one", "each"], config: argparse.Namespace
) -> dict[str, Any]:
    """Returns what a field reaches, `exposure` being the setting of the scene's model."""
    found, dependence = evidence_of(photographs)
    cameras, points, fitted = photographs.cameras, photographs.points, photographs.fitted
    settings = SceneModelConfig(
        exposure=exposure, image_long_side=config.long_side_px, max_voxels=config.points**3
    )
    train, observed = [cameras[k] for k in fitted], points.of_images(fitted)
    model = decide_scene_model(train, points.xyz_world, settings, dependence, exposure=found)
    views, images = reduced(photographs, model, fitted)
    depths = observed_depths(
        model, train, observed, [photographs.images[k] for k in fitted], [None] * len(fitted)
    )
    exposures = view_exposures(train, model.exposures, CPU)
    free = torch.from_numpy(free_space(model, train, observed))
    field, curve = train_field(
        TrainingViews(views, torch.from_numpy(images), depths, exposures),
        FieldVolume(model.space, model.resolution, free),
        FieldTrainingConfig(iterations=config.iterations),
        kernels_for(CPU),
    )
    views, images = reduced(photographs, model, photographs.held_out)
    renders = [r.color.numpy() for r in rendered(field, model.space, views, RenderConfig(), CPU)]
    pairs = list(zip(renders, map(from_integers, images), strict=True))
    return {
        "shading": model.shading,
        "chosen": model.evidence["exposure"]["chosen"],
        "spread": round(found.spread, 4),
        "train_psnr": round(curve[-1].psnr, 2),
        "psnr": round(float(np.mean([psnr(*pair) for pair in pairs])), 2),
        "psnr_exposed": round(float(np.mean([psnr_exposed(*pair) for pair in pairs])), 2),
        "frame_rms": round(frame_rms(field, model, model.normalized(cameras)), 5),
    }


def reduced(
    photographs: Photographs, model: SceneModel, rows: Sequence[int]
) -> tuple[list[Camera], np.ndarray]:
    """Returns cameras and images of some photographs as the model has them, uint8."""
    cameras = model.normalized([photographs.cameras[k] for k in rows])
    images = [
        cv2.resize(
            photographs.images[k], (camera.width, camera.height), interpolation=cv2.INTER_AREA
        )
        for k, camera in zip(rows, cameras, strict=True)
    ]
    return cameras, np.stack([to_integers(image) for image in images])


def main() -> None:
    """Prints a row of JSON a measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["evidence", "fit"])
    parser.add_argument("scenes", nargs="+")
    for name in ("exposure", "white-balance", "power"):
        parser.add_argument(f"--{name}", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--iterations", type=int, default=1200)
    parser.add_argument("--long-side-px", type=int, default=252)
    parser.add_argument("--points", type=int, default=112)
    parser.add_argument("--modes", nargs="+", default=["one", "each"])
    config = parser.parse_args()
    changes = Changes(config.exposure, config.white_balance, config.power, config.seed)
    for scene in config.scenes:
        photographs = photographs_of(scene, changes)
        capture_words = {"scene": scene, "views": len(photographs.cameras)} | vars(changes)
        if config.what == "evidence":
            found, dependence = evidence_of(photographs)
            rows = [{"spread": found.spread, "disagreement": found.disagreement}]
            rows[0] |= {"needed": found.needed, "view_dependence": dependence.share}
        else:
            rows = [{"setting": mode} | fit(photographs, mode, config) for mode in config.modes]
        for row in rows:
            print(json.dumps(capture_words | row), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
