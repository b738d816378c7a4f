"""What a scene's photographs are worth, before hours are spent on them."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import luigi

from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask
from tasks.results.job_costs import job_costs
from tasks.stages.linked_results import LinkedStage
from tasks.stages.scene import CameraPoses, SceneCapture, SceneModel
from tasks.stages.stage import PresetStage, Stage

EXPECTED = ("draft", "standard")  # `paper` fills the memory of a small machine


class SceneReport(LinkedStage, PresetStage):
    """A page about a scene: cameras, coverage, outliers, the model, the time and PSNR to expect.

    Leaves `report.html` and `summary.json`, linked from `out/SCENE/scene-report/`.
    """

    scene = luigi.Parameter(description="a folder in data/scenes, or a video there")
    tools = ("numba", "opencv-contrib-python-headless", "torch")
    uses_device = True

    def requires(self) -> Mapping[str, Stage]:
        """The photographs, their cameras, and the model of the quality asked for."""
        return {
            "capture": self.upstream(SceneCapture),
            "poses": self.upstream(CameraPoses),
            "model": self.upstream(SceneModel),
        }

    def identity_parameters(self) -> Mapping[str, object]:
        """The scene's name, which the page repeats, and the settings that replace the presets'."""
        return {"scene": self.scene} | ({"tuning": self.tuning} if self.tuning else {})

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Survey the photographs, fit two brief fields at each quality, write the page."""
        from styletrf.devices import device_named
        from styletrf.files.tables import write_summary
        from styletrf.reports.scene_report import advice, write_scene_report
        from styletrf.scene.scene_model import read_scene_model

        model = read_scene_model(inputs["model"] / "scene.json")
        expected = self._expectations(inputs["poses"], model, device_named(self.device), run)
        content = self._content(inputs, expected)
        summary = {
            "advice": advice(content),
            "seen_by_fewer_than_3": content.survey.sparse_share,
            "seconds": {quality: each.field.seconds for quality, each in expected.items()},
            "job_seconds": {quality: each.job_seconds for quality, each in expected.items()},
            "expected_psnr": {quality: each.psnr_db for quality, each in expected.items()},
            "views": {view.name: view.exposure_ev for view in content.survey.views},
        }
        write_summary(out / "summary.json", summary)
        write_scene_report(out / "report.html", content)

    def _content(self, inputs: Mapping[str, Path], expected: dict[str, Any]) -> Any:
        from styletrf.files.images import read_rgb, to_integers
        from styletrf.files.tables import read_summary
        from styletrf.geometry.camera_table import read_cameras, read_unregistered
        from styletrf.geometry.point_table import read_points
        from styletrf.reports.scene_report import SceneReportContent
        from styletrf.reports.survey_drawing import drawings
        from styletrf.scene.placement import transformed
        from styletrf.scene.scene_model import read_scene_model
        from styletrf.scene.survey import survey_scene
        from tasks.summary.report_content import registration_summary

        cameras = read_cameras(inputs["poses"] / "cameras.parquet")
        points = read_points(inputs["poses"] / "points.parquet")
        model = read_scene_model(inputs["model"] / "scene.json")
        normalized = model.normalized(cameras)
        images = (
            to_integers(read_rgb(inputs["poses"] / "images" / f"{c.name}.png")) for c in cameras
        )
        points_normalized = transformed(model.normalized_from_world, points.xyz_world)
        points_grid = model.space.to_grid(points_normalized)
        survey = survey_scene(images, points, points_grid, model.space, normalized)
        unregistered = read_unregistered(inputs["poses"] / "cameras.parquet")
        flagged = {view.name for view in survey.views if view.blurred or view.off_exposure}
        return SceneReportContent(
            scene=self.scene,
            summary=registration_summary(inputs["poses"], inputs["capture"]),
            survey=survey,
            unregistered=unregistered,
            neighbors=_neighbors(unregistered, [camera.name for camera in cameras]),
            drawings=drawings(normalized, points_normalized, points.rgb, frozenset(flagged)),
            model={
                "space": model.space.kind,
                "lattice": " x ".join(map(str, model.resolution)),
                "photographs at": f"{model.image_width} x {model.image_height}",
                "shading": model.shading,
                "exposure": "each photograph's own" if model.exposures else "one for all",
                "photographers looked": model.looking,
            },
            expected=expected,
            evidence=model.evidence,
            doubts=read_summary(inputs["poses"] / "poses.json")["doubts"],
        )

    def _expectations(
        self, poses: Path, decided: Any, device: Any, run: RunContext
    ) -> dict[str, Any]:
        """Returns the time, the memory and the PSNR to expect, by quality."""
        from styletrf.evaluation.expected_quality import expected_psnr
        from styletrf.field.kernels import kernels_for
        from styletrf.field.training.cost import field_cost
        from styletrf.reports.expectation import Expectation
        from styletrf.scene.training_photographs import read_training_photographs

        expectations = {}
        photographs, kernels = read_training_photographs(poses), kernels_for(device)
        jobs = job_costs(self.scene, self.device, EXPECTED, self.tuning)
        for k, (quality, job) in enumerate(jobs.items()):
            run.progress(k, len(jobs))
            model, fit = self._fit(photographs, decided, quality)
            cost = field_cost(model, photographs, fit, kernels, device)
            psnr_db = expected_psnr(photographs, model, fit, kernels, device)
            seconds = job.seconds - job.field_seconds + cost.seconds
            memory = max(job.peak_memory_bytes, cost.peak_memory_bytes)
            expectations[quality] = Expectation(cost, seconds, memory, job.output_bytes, psnr_db)
        return expectations

    def _fit(self, photographs: Any, decided: Any, quality: str) -> tuple[Any, Any]:
        """Returns the scene model and the configuration of the fit at a quality."""
        from styletrf.configuration import configured
        from styletrf.field.training.config import FieldTrainingConfig
        from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model

        settings = {**self.tuned("SceneModel", quality), "space": decided.space.kind}
        config = configured(SceneModelConfig, settings)
        model = decide_scene_model(photographs.cameras, photographs.points.xyz_world, config)
        settings = {"field.shading": decided.shading, **self.tuned("RadianceField", quality)}
        fit = configured(FieldTrainingConfig, settings)
        return replace(model, exposures=decided.exposures), fit

    @property
    def folder(self) -> Path:
        """Where the page is shown."""
        return Path(out_root(), self.scene, "scene-report")

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """The page and its numbers."""
        return {name: place(self) / name for name in ("report.html", "summary.json")}


def _neighbors(unregistered: list[str], registered: list[str]) -> dict[str, tuple[str, str]]:
    """Returns the photographs with a camera before and after each that has none, by name."""
    ordered = sorted(registered)
    result = {}
    for name in unregistered:
        before = [other for other in ordered if other < name] or ordered[:1]
        after = [other for other in ordered if other > name] or ordered[-1:]
        result[name] = (before[-1], after[0])
    return result
