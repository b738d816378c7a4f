"""The quality of a field on held-out photographs."""

from collections.abc import Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

from styletrf.capture.views import load_views
from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.alignment.held_out_alignment import aligned_psnr
from styletrf.evaluation.alignment.photograph_placement import place_unregistered
from styletrf.evaluation.exposed_image import psnr_exposed
from styletrf.evaluation.quality import (
    QualityConfig,
    measure_quality,
    requested_metrics,
    views_that_count,
)
from styletrf.field.radiance_field import load_field
from styletrf.files.tables import write_rows, write_summary
from styletrf.geometry.camera_table import read_split
from styletrf.geometry.cameras import Camera
from styletrf.scene.scene_model import read_scene_model
from styletrf.steps.step_run import StepRun
from styletrf.trajectory.frames import rendered


def measure_field(
    inputs: Mapping[str, Path], out: Path, settings: Mapping[str, Any], run: StepRun
) -> None:
    """Writes `views.parquet`, `summary.json`, `placed.json`, and renders beside photographs.

    Args:
        inputs: `capture`, `field`, `perceptual`, `poses` and `model`.
        out: The folder to fill.
        settings: Those of `QualityConfig`.
        run: Its progress is the number of views.
    """
    model = read_scene_model(inputs["model"] / "scene.json")
    config, device = configured(QualityConfig, settings), device_named(run.device_name)
    held_out = model.normalized(
        read_split(inputs["poses"] / "cameras.parquet")[1], config.long_side_px
    )
    cameras, photographs = views_that_count(
        held_out, load_views(inputs["poses"] / "images", held_out)
    )
    radiance = load_field(inputs["field"])
    renders = rendered(radiance, model.space, cameras, config.render, device, run.progress)
    metrics = requested_metrics(config, inputs["perceptual"] / "vgg16.safetensors", device)
    if model.exposures:
        metrics["psnr_exposed"] = psnr_exposed
    (out / "views").mkdir()
    rows, means = measure_quality(renders, cameras, photographs, metrics, out / "views")

    def render(camera: Camera) -> Any:
        """Returns the render of a camera."""
        return next(rendered(radiance, model.space, [camera], config.render, device))

    if config.aligned:
        psnrs = [row["psnr"] for row in rows]
        found = aligned_psnr(cameras, psnrs, photographs, render)
        rows = [{**row, "psnr_aligned": value} for row, value in zip(rows, found, strict=True)]
        means["psnr_aligned"] = fmean(found)
    write_rows(out / "views.parquet", rows)
    write_summary(out / "summary.json", means)
    place_unregistered(out / "placed.json", inputs["capture"], inputs["poses"], model, render)
