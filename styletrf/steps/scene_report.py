"""The report of a scene: a survey of its photographs, and the expected cost of a fly-through."""

import math
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from styletrf.capture.photographs import natural_order
from styletrf.configuration import configured
from styletrf.devices import device_named
from styletrf.evaluation.expected_quality import expected_psnr
from styletrf.field.kernels import kernels_for
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.cost import FieldCost, field_cost
from styletrf.files.images import read_rgb, to_integers
from styletrf.files.tables import read_summary, write_summary
from styletrf.geometry.camera_table import read_cameras, read_unregistered
from styletrf.geometry.point_table import read_points
from styletrf.reports.coverage_text import registration_summary
from styletrf.reports.expectation import Expectation
from styletrf.reports.scene_report import SceneReportContent, advice, write_scene_report
from styletrf.reports.survey_drawing import drawings
from styletrf.scene.placement import transformed
from styletrf.scene.scene_model import (
    SceneModel,
    SceneModelConfig,
    decide_scene_model,
    read_scene_model,
)
from styletrf.scene.survey import survey_scene
from styletrf.scene.training_photographs import TrainingPhotographs, read_training_photographs
from styletrf.steps.step_run import StepRun


@dataclass(frozen=True, slots=True)
class PlannedJob:
    """The cost of a whole fly-through at a quality, and the settings of two of its stages.

    Attributes:
        seconds: The seconds of all stages but the field, one after the other.
        field_seconds: The predicted seconds of the field.
        peak_memory_bytes: The peak memory of the stage that takes most.
        output_bytes: The bytes of all artifacts on disk.
        model: The settings of `SceneModelConfig`.
        field: The settings of `FieldTrainingConfig`.
        is_tried: Whether the field is timed, and fitted briefly to predict its PSNR.
    """

    seconds: float
    field_seconds: float
    peak_memory_bytes: int
    output_bytes: int
    model: Mapping[str, Any]
    field: Mapping[str, Any]
    is_tried: bool


def report_scene(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    scene: str,
    jobs: Mapping[str, PlannedJob],
    machine: str,
) -> None:
    """Writes `report.html` and `summary.json`.

    Args:
        inputs: `capture`, `poses` and `model`.
        out: The folder to fill.
        settings: Empty.
        run: Its progress is the number of qualities.
        scene: Its name, for the page.
        jobs: The jobs by quality; the field of each that is tried is fitted briefly, twice.
        machine: The description of the machine, for the page.
    """
    expected = _expectations(inputs, jobs, run)
    content = _content(inputs, scene, expected, machine)
    summary = {
        "advice": advice(content),
        "seen_by_fewer_than_3": content.survey.sparse_fraction,
        "seconds": {quality: each.field.seconds for quality, each in expected.items()},
        "job_seconds": {quality: each.job_seconds for quality, each in expected.items()},
        "expected_psnr": {quality: each.psnr_db for quality, each in expected.items()},
        "views": {view.name: view.exposure_ev for view in content.survey.views},
    }
    write_summary(out / "summary.json", summary)
    write_scene_report(out / "report.html", content)


def _expectations(
    inputs: Mapping[str, Path], jobs: Mapping[str, PlannedJob], run: StepRun
) -> dict[str, Expectation]:
    """Returns the time, the memory and the PSNR to expect, by quality."""
    decided, place = read_scene_model(inputs["model"] / "scene.json"), device_named(run.device_name)
    photographs, kernels = read_training_photographs(inputs["poses"]), kernels_for(place)
    expectations = {}
    for k, (quality, job) in enumerate(jobs.items()):
        run.progress(k, len(jobs))
        model, fit = _fit(photographs, decided, job)
        if not job.is_tried:
            expectations[quality] = _predicted(model, job)
            continue
        cost = field_cost(model, photographs, fit, kernels, place)
        psnr_db = expected_psnr(photographs, model, fit, kernels, place)
        memory = max(job.peak_memory_bytes, cost.peak_memory_bytes)
        seconds = job.seconds + cost.seconds
        expectations[quality] = Expectation(cost, seconds, memory, job.output_bytes, psnr_db)
    return expectations


def _predicted(model: SceneModel, job: PlannedJob) -> Expectation:
    """Returns the expectation for a job whose field is not tried."""
    voxels, memory = math.prod(model.resolution), job.peak_memory_bytes
    cost = FieldCost(job.field_seconds, memory, voxels)
    seconds = job.seconds + cost.seconds
    return Expectation(cost, seconds, memory, job.output_bytes, None, is_tried=False)


def _fit(
    photographs: TrainingPhotographs, decided: SceneModel, job: PlannedJob
) -> tuple[SceneModel, FieldTrainingConfig]:
    """Returns the scene model and the configuration of the fit that a job would have."""
    config = configured(SceneModelConfig, {**job.model, "space": decided.space.kind})
    model = decide_scene_model(photographs.cameras, photographs.points.xyz_world, config)
    fit = configured(FieldTrainingConfig, {"field.shading": decided.shading, **job.field})
    return replace(model, exposures=decided.exposures), fit


def _content(
    inputs: Mapping[str, Path], scene: str, expected: Mapping[str, Expectation], machine: str
) -> SceneReportContent:
    cameras = read_cameras(inputs["poses"] / "cameras.parquet")
    points = read_points(inputs["poses"] / "points.parquet")
    model = read_scene_model(inputs["model"] / "scene.json")
    normalized = model.normalized(cameras)
    images = (to_integers(read_rgb(inputs["poses"] / "images" / f"{c.name}.png")) for c in cameras)
    points_normalized = transformed(model.normalized_from_world, points.xyz_world)
    points_grid = model.space.to_grid(points_normalized)
    survey = survey_scene(images, points, points_grid, model.space, normalized)
    unregistered = read_unregistered(inputs["poses"] / "cameras.parquet")
    flagged = {view.name for view in survey.views if view.blurred or view.off_exposure}
    return SceneReportContent(
        scene=scene,
        summary=registration_summary(inputs["poses"], inputs["capture"]),
        survey=survey,
        unregistered=unregistered,
        neighbors=neighbors(unregistered, [camera.name for camera in cameras]),
        drawings=drawings(normalized, points_normalized, points.rgb, frozenset(flagged)),
        model=_described(model),
        expected=expected,
        machine=machine,
        evidence=model.evidence,
        doubts=read_summary(inputs["poses"] / "poses.json")["doubts"],
    )


def _described(model: SceneModel) -> dict[str, object]:
    return {
        "space": model.space.kind,
        "lattice": " x ".join(map(str, model.resolution)),
        "photographs at": f"{model.image_width} x {model.image_height}",
        "shading": model.shading,
        "exposure": "each photograph's own" if model.exposures else "one for all",
        "photographers looked": model.looking,
    }


def neighbors(unregistered: list[str], registered: list[str]) -> dict[str, tuple[str, str]]:
    """Returns the photographs with a camera before and after each that has none, by name.

    Before the first and after the last, that neighbor is given twice.
    """
    ordered, result = sorted(registered, key=natural_order), {}
    for name in unregistered:
        place = bisect_left(ordered, natural_order(name), key=natural_order)
        result[name] = ordered[max(place - 1, 0)], ordered[min(place, len(ordered) - 1)]
    return result
