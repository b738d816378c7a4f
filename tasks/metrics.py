"""What is measured: the field against photographs, the stylised frames against each other."""

from collections.abc import Mapping
from pathlib import Path

import luigi

from pipeline.task import RunContext
from tasks.controls import FrameControls
from tasks.field import RadianceField, TrajectoryFrames
from tasks.scene import CameraPoses, SceneModel
from tasks.stage import Stage, TunedStage
from tasks.stylization import StylizedFrames


class QualityMetrics(TunedStage):
    """PSNR and SSIM on the photographs held out, every eighth.

    Leaves `views.parquet`, `summary.json`, and each render beside its photograph in `views/`.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    tools = ("torch",)
    computes = True

    def requires(self) -> Mapping[str, Stage]:
        """The field and the photographs."""
        return {
            "field": self.need(RadianceField),
            "poses": self.need(CameraPoses),
            "model": self.need(SceneModel),
        }

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Render the views held out and compare."""
        from styletrf.camera_table import read_split
        from styletrf.configuration import configured
        from styletrf.devices import device_named
        from styletrf.field import load_field
        from styletrf.quality import measure_quality
        from styletrf.rendering import RenderConfig
        from styletrf.scene_model import read_scene_model
        from styletrf.tables import write_rows, write_summary
        from styletrf.views import load_views

        model = read_scene_model(inputs["model"] / "scene.json")
        cameras = model.normalized(read_split(inputs["poses"] / "cameras.parquet")[1])
        (out / "views").mkdir()
        rows, means = measure_quality(
            load_field(inputs["field"]),
            model.space,
            cameras,
            load_views(inputs["poses"] / "images", cameras),
            configured(RenderConfig, self.values()),
            device_named(self.device),
            out / "views",
            run.progress,
        )
        write_rows(out / "views.parquet", rows)
        write_summary(out / "summary.json", means)


class ConsistencyMetrics(TunedStage, FrameControls):
    """The paper's short- and long-term error of the stylised frames, with floors.

    Leaves `pairs.parquet` and `summary.json`.
    """

    tools = ("opencv-contrib-python-headless",)

    def requires(self) -> Mapping[str, Stage]:
        """The frames with and without style."""
        return {
            "unstylized": self.need(TrajectoryFrames),
            "stylized": self.need(StylizedFrames),
        }

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Warp and compare."""
        from styletrf.camera_table import read_cameras
        from styletrf.configuration import configured
        from styletrf.consistency import ConsistencyConfig, measure_consistency
        from styletrf.tables import write_rows, write_summary

        names = [camera.name for camera in read_cameras(inputs["unstylized"] / "cameras.parquet")]
        config = configured(ConsistencyConfig, self.values())
        consistency = measure_consistency(
            [inputs["unstylized"] / "frames" / f"{name}.exr" for name in names],
            [inputs["stylized"] / "frames" / f"{name}.png" for name in names],
            config.deltas,
            config.method,
            run.progress,
        )
        write_rows(out / "pairs.parquet", consistency.pairs)
        write_summary(out / "summary.json", consistency.summary)
