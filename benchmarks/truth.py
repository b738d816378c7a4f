"""Poses and depth against what is true of a scene: `python benchmarks/truth.py --help`.

    truth.py poses horns fern fox
    truth.py depth courtyard --field FOLDER [--set model.space='"box"']
    truth.py flow --iterations 5000

`poses` solves the poses of a scene that came with some, and compares the two after the similarity
that fits the centers best. `depth` compares a field's median depth at held-out views of a courtyard
(`python -m styletrf.synthetic.courtyard`) with the exact one, in units of the scene's median depth.
`flow` fits a field to a courtyard with its exact cameras, and compares the flow between nearby
views by the field's depth with the exact one, where both say that the other view sees the place.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import luigi
import numpy as np
import torch
from field import settings_of
from given_scenes import load_given_scene
from task_of import task_of

from pipeline.task import artifact
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import load_field
from styletrf.field.training.field_training import train_field
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera, fitted_to, pixel_centers, points_at_depth
from styletrf.geometry.exact_flow import exact_flow
from styletrf.scene.scene_model import decide_scene_model
from styletrf.synthetic.courtyard import CourtyardConfig, capture_courtyard
from styletrf.synthetic.courtyard import render_view as photographed
from styletrf.trajectory.frames import rendered
from tasks.stages.scene import CameraPoses


def similarity(source: np.ndarray, target: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Returns scale, rotation and offset of target = scale rotation source + offset (Umeyama)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    u, singular, vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ sign @ vt
    scale = float((singular * np.diag(sign)).sum() / (a**2).sum())
    return scale, rotation, target.mean(axis=0) - scale * rotation @ source.mean(axis=0)


def agreement(ours: Sequence[Camera], given: Sequence[Camera]) -> dict[str, float]:
    """Returns the errors of rotations, in degrees, and of centers, by the extent of all.

    The similarity has the mean rotation between the cameras' axes, and the scale and the offset
    that then fit the centers: these alone, in one plane nearly, tell a rotation badly.
    """
    centers, targets = (np.stack([c.center_world for c in part]) for part in (ours, given))
    axes = [np.stack([c.world_from_camera[:, :3] for c in part]) for part in (given, ours)]
    u, _, vt = np.linalg.svd(np.einsum("nij,nkj->ik", *axes))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    turned_centers = (centers - centers.mean(axis=0)) @ rotation.T
    scale = (turned_centers * (targets - targets.mean(axis=0))).sum() / (turned_centers**2).sum()
    offset = targets.mean(axis=0) - scale * rotation @ centers.mean(axis=0)
    away = np.linalg.norm(scale * centers @ rotation.T + offset - targets, axis=1)
    turned = [
        np.trace((rotation @ a.world_from_camera[:, :3]).T @ b.world_from_camera[:, :3])
        for a, b in zip(ours, given, strict=True)
    ]
    angle_deg = np.degrees(np.arccos(np.clip((np.array(turned) - 1) / 2, -1, 1)))
    extent = float(np.linalg.norm(np.ptp(targets, axis=0)))
    return {
        "median_rotation_deg": float(np.median(angle_deg)),
        "max_rotation_deg": float(angle_deg.max()),
        "median_center_share": float(np.median(away)) / extent,
        "max_center_share": float(away.max()) / extent,
    }


def poses(options: argparse.Namespace) -> None:
    """Prints how solved poses differ from given ones."""
    for scene in options.scenes:
        given = task_of(CameraPoses, scene=scene, quality="draft")
        solved = task_of(CameraPoses, scene=scene, quality="draft", settings={"poses": "solved"})
        if not luigi.build([given, solved], local_scheduler=True, log_level="WARNING"):
            raise SystemExit(f"{scene} has no poses")
        of = {c.name: c for c in read_cameras(artifact(given) / "cameras.parquet")}
        ours = [c for c in read_cameras(artifact(solved) / "cameras.parquet") if c.name in of]
        row: dict[str, Any] = {"scene": scene, "placed": len(ours), "given": len(of)}
        print(json.dumps(row | agreement(ours, [of[c.name] for c in ours])))  # noqa: T201


def depth(options: argparse.Namespace) -> None:
    """Prints the errors of a field's depth at the held-out views of a courtyard."""
    settings = settings_of(options)
    scene = load_given_scene(options.scene, settings.model)
    truth = options.truth
    exact = {Path(c.name).stem: c for c in read_cameras(truth / "cameras.parquet")}
    cameras = [*scene.train.cameras, *scene.test.cameras]
    targets = np.stack([exact[c.name].center_world for c in cameras])
    scale, _, _ = similarity(np.stack([c.center_world for c in cameras]), targets)
    errors, depths = [], []
    renders = rendered(
        load_field(options.field), scene.model.space, scene.test.cameras, settings.render,
        torch.device("cpu"),
    )  # fmt: skip
    for camera, render in zip(scene.test.cameras, renders, strict=True):
        true = np.load(truth / "depth" / f"{camera.name}.npy")
        depth = scale * render.median_depth.numpy()
        rows = np.linspace(0, len(true) - 1, len(depth)).round().astype(int)
        columns = np.linspace(0, true.shape[1] - 1, depth.shape[1]).round().astype(int)
        true = true[np.ix_(rows, columns)]
        both = np.isfinite(true) & np.isfinite(depth)
        errors.append(np.abs(depth - true)[both])
        depths.append(true[both])
    middle = float(np.median(np.concatenate(depths)))
    print(json.dumps({  # noqa: T201
        "scene": options.scene, "median_depth_m": middle,
        "median_error_m": float(np.median(np.concatenate(errors))),
        "median_error_share": float(np.median(np.concatenate(errors))) / middle,
    }))  # fmt: skip


def flow(options: argparse.Namespace) -> None:
    """Prints the errors in pixels of the flow by a field's depth."""
    config = CourtyardConfig(kind="forward")
    capture = capture_courtyard(config)
    points = np.concatenate(
        [_points_world(*v) for v in zip(capture.cameras, capture.depths, strict=True)]
    )
    settings = settings_of(options)
    model = decide_scene_model(capture.cameras, points[::997], settings.model)
    cameras = model.normalized(capture.cameras)
    kernels, cpu = kernels_for(torch.device("cpu")), torch.device("cpu")
    images = torch.from_numpy(np.stack([_reduced(i, cameras[0]) for i in capture.images]))
    training = replace(settings.training, iterations=options.iterations)
    volume = FieldVolume(model.space, model.resolution)
    field, _ = train_field(TrainingViews(cameras, images), volume, training, kernels)
    errors, fractions = [], []
    for camera in capture.cameras[:: options.every]:
        pair = _step_aside(camera, 0.02 * options.apart)
        views = model.normalized(pair)
        renders = list(rendered(field, model.space, views, settings.render, cpu))
        world = [fitted_to(c, max(views[0].width, views[0].height)) for c in pair]
        true = [photographed(c, config)[1] for c in world]
        found, seen = exact_flow(
            views[0],
            renders[0].surface_depth.numpy(),
            views[1],
            renders[1].surface_depth.numpy(),
            0.02,
        )
        exact, visible = exact_flow(world[0], true[0], world[1], true[1])
        both = seen & visible & np.isfinite(true[0])
        errors.append(np.linalg.norm(found - exact, axis=-1)[both])
        fractions.append(float(seen.mean()))
    error = np.concatenate(errors)
    print(json.dumps({  # noqa: T201
        "views": len(errors), "median_px": float(np.median(error)),
        "p90_px": float(np.quantile(error, 0.9)), "p99_px": float(np.quantile(error, 0.99)),
        "within_0.1_px": float((error < 0.1).mean()), "seen": float(np.mean(fractions)),
    }))  # fmt: skip


def _step_aside(camera: Camera, meters: float) -> list[Camera]:
    pose = camera.world_from_camera.copy()
    pose[:, 3] += meters * pose[:, 0]
    return [camera, replace(camera, world_from_camera=pose)]


def _reduced(image: np.ndarray, camera: Camera) -> np.ndarray:
    return cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)


def _points_world(camera: Camera, depth: np.ndarray) -> np.ndarray:
    is_surface = np.isfinite(depth.reshape(-1))
    pixels = pixel_centers(camera.width, camera.height)[is_surface]
    return points_at_depth(camera, pixels, depth.reshape(-1)[is_surface])


def main() -> None:
    """Runs the mode that the command line names."""
    result = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    modes = result.add_subparsers(required=True)
    one = modes.add_parser("poses", help=poses.__doc__)
    one.add_argument("scenes", nargs="+")
    one.set_defaults(run=poses)
    two = modes.add_parser("depth", help=depth.__doc__)
    two.add_argument("scene")
    two.add_argument("--truth", type=Path, required=True, help="the capture's `truth` folder")
    two.add_argument("--field", type=Path, required=True)
    two.add_argument("--quality", default="draft")
    two.add_argument("--seed", type=int, default=0)
    two.add_argument("--set", nargs="*", default=[], metavar="NAME=JSON")
    two.set_defaults(run=depth)
    three = modes.add_parser("flow", help=flow.__doc__)
    three.add_argument("--iterations", type=int, default=5000)
    three.add_argument("--every", type=int, default=8, help="of the views, which are looked at")
    three.add_argument("--apart", type=int, default=1, help="steps of two centimeters")
    three.add_argument("--quality", default="draft")
    three.add_argument("--seed", type=int, default=0)
    three.add_argument("--set", nargs="*", default=[], metavar="NAME=JSON")
    three.set_defaults(run=flow)
    options = result.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
