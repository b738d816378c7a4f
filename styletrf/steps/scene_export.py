"""A scene in the files of other programs."""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from styletrf.capture.views import load_views
from styletrf.devices import device_named
from styletrf.evaluation.quality import views_that_count
from styletrf.exports.blender_bundle import write_blender_bundle
from styletrf.exports.camera_files import write_colmap_model, write_transforms
from styletrf.exports.export_views import (
    ExportViews,
    Look,
    export_views,
    offset_world,
    stored_from_normalized,
)
from styletrf.exports.splat_export import MOST_SPLATS, HeldOut, export_splats
from styletrf.exports.surface_export import export_mesh, export_points
from styletrf.field.radiance_field import load_field, load_stylized_field
from styletrf.files.video_frames import video_info
from styletrf.geometry.camera_table import read_cameras, read_split
from styletrf.geometry.cameras import Camera, moved
from styletrf.geometry.point_table import read_points
from styletrf.scene.scene_model import SceneModel, read_scene_model
from styletrf.steps.step_run import StepRun

ExportFormat = Literal["ply", "spz", "points", "mesh", "blender", "cameras"]
PHOTOGRAPHS = "photographs"


def export_scene(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    file_format: ExportFormat,
    styles: Sequence[str],
) -> None:
    """Writes the files of one format, and `export.json` with their content and loss.

    Args:
        inputs: `poses`, `trajectory`, `model`; but for cameras `field`, and `stylized NAME` of each
            style.
        out: The folder to fill.
        settings: Empty.
        run: Its progress is counted after every picture, style and iteration.
        file_format: See `docs/exports.md`.
        styles: Names of the styles.

    Raises:
        InputError: There is no surface to export, or many splats are too far away for `spz`.
    """
    if file_format == "cameras":
        report = _export_cameras(inputs, out)
    else:
        model = read_scene_model(inputs["model"] / "scene.json")
        views = _views(inputs, model, run)
        looks = _looks(inputs, views, styles)
        if file_format in ("ply", "spz"):
            held_out = _held_out(inputs["poses"], model)
            report = export_splats(
                out, file_format, views, looks, held_out, MOST_SPLATS, run.progress
            )
        elif file_format == "points":
            report = export_points(out, views, looks, run.progress)
        else:
            report = export_mesh(out, views, looks, run.progress)
        report["offset_world"] = offset_world(model).tolist()
        if file_format == "blender":
            _write_bundle(inputs, out, model)
    text = json.dumps({"format": file_format, **report}, indent=1, sort_keys=True)
    (out / "export.json").write_text(text + "\n")


def _views(inputs: Mapping[str, Path], model: SceneModel, run: StepRun) -> ExportViews:
    fitted, _ = read_split(inputs["poses"] / "cameras.parquet")
    path = read_cameras(inputs["trajectory"] / "cameras.parquet")
    field = load_field(inputs["field"])
    device = device_named(run.device_name)
    return export_views(model, field, model.normalized(fitted), path, device, run.progress)


def _looks(inputs: Mapping[str, Path], views: ExportViews, styles: Sequence[str]) -> list[Look]:
    def photographs() -> Any:
        return views.field

    stylized: list[tuple[str, Callable[[], Any]]] = [
        (style, partial(load_stylized_field, inputs["field"], inputs[f"stylized {style}"]))
        for style in styles
    ]
    return [(PHOTOGRAPHS, photographs), *stylized]


def _held_out(poses: Path, model: SceneModel) -> HeldOut:
    cameras = model.normalized(read_split(poses / "cameras.parquet")[1])
    return HeldOut(*views_that_count(cameras, load_views(poses / "images", cameras)))


def _export_cameras(inputs: Mapping[str, Path], out: Path) -> dict[str, Any]:
    """Writes the photographs' cameras and points, and the fly-through's, in COLMAP's world."""
    cameras = read_cameras(inputs["poses"] / "cameras.parquet")
    points = read_points(inputs["poses"] / "points.parquet")
    model = read_scene_model(inputs["model"] / "scene.json")
    path = _path(inputs, np.linalg.inv(model.normalized_from_world))
    write_transforms(out / "transforms.json", cameras, "images", ".png")
    write_transforms(out / "transforms_path.json", path, "frames", ".exr")
    sparse, sparse_path = out / "sparse/0", out / "sparse_path/0"
    for folder in (sparse, sparse_path):
        folder.mkdir(parents=True)
    write_colmap_model(sparse, cameras, ".png", points)
    write_colmap_model(sparse_path, path, ".exr")
    scale = float(np.cbrt(np.linalg.det(model.normalized_from_world[:3, :3])))
    counts = {"photographs": len(cameras), "path": len(path), "points": len(points.xyz_world)}
    return {**counts, "world_units_per_depth": 1 / scale}


def _write_bundle(inputs: Mapping[str, Path], out: Path, model: SceneModel) -> None:
    rate = float(video_info(inputs["trajectory"] / "video.mp4").frames_per_second)
    stored = stored_from_normalized(model)
    stored_from_world = stored @ model.normalized_from_world
    cameras = read_cameras(inputs["poses"] / "cameras.parquet")
    photographed = [moved(camera, stored_from_world) for camera in cameras]
    write_blender_bundle(out, photographed, _path(inputs, stored), rate)


def _path(inputs: Mapping[str, Path], new_from_normalized: np.ndarray) -> list[Camera]:
    """Returns the fly-through's cameras in a new world."""
    path = read_cameras(inputs["trajectory"] / "cameras.parquet")
    return [moved(camera, new_from_normalized) for camera in path]
