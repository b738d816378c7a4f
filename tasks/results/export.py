"""A scene in some styles, in the files of other programs."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

from pipeline.parameters import ChoiceParameter, NamesParameter
from pipeline.settings import out_root
from pipeline.task import RunContext, StoredTask
from styletrf.errors import InputError
from tasks.machine.optional_dependencies import EXPORT_PACKAGES, export_versions
from tasks.results.scene_in_styles import SceneInStyles
from tasks.stages.field import RadianceField, TrajectoryFrames
from tasks.stages.scene import CameraPoses, SceneModel
from tasks.stages.stage import Stage
from tasks.stages.stylization import StylizedField

PHOTOGRAPHS = "photographs"
_CAMERA_FILES = ("transforms.json", "transforms_path.json", "sparse", "sparse_path")
_SUFFIXES = {"ply": "ply", "spz": "spz", "points": "ply", "mesh": "glb", "blender": "glb"}
_BESIDE = {
    "ply": ("colors.safetensors",),
    "spz": ("colors.safetensors",),
    "blender": ("cameras.json", "import_scene.py"),
}


class _FormatParameter(ChoiceParameter):
    """A format by its name, or a mesh by the suffix of its file."""

    def normalize(self, var: str) -> str:
        """Returns the name of the format."""
        return str(super().normalize({"glb": "mesh"}.get(var, var)))  # type: ignore[no-untyped-call]


class Export(SceneInStyles):
    """Files of one format for other programs: one geometry, and every style on it.

    Leaves the files that `docs/exports.md` lists, linked from `out/SCENE/export/FORMAT/`.
    """

    styles: Any = NamesParameter(default=(), description='such as ["mosaic", "udnie"]')
    format = _FormatParameter(
        choices=list(EXPORT_PACKAGES),
        description="Gaussian splats (ply, spz), colored points, a mesh (or glb), a bundle for"
        " Blender, or cameras and depths",
    )
    tools = ("av", "numba", "opencv-contrib-python-headless", "pycolmap", "torch")
    uses_device = True
    page = "export.json"

    def validate(self) -> None:
        """Rejects invalid styles, styles of cameras, and a format whose packages are missing.

        Raises:
            InputError: The error says what to give, or to install, instead.
        """
        super().validate()
        if self.format == "cameras" and self.styles:
            problem = "has no effect on --format cameras, which has no styles"
            raise InputError(f"--styles {list(self.styles)}", problem, "Leave it out")
        export_versions(self.format)

    def requires(self) -> Mapping[str, Stage]:
        """Returns the cameras; for all other formats also the density and the appearances."""
        needed: dict[str, Stage] = {
            "model": self.upstream(SceneModel),
            "poses": self.upstream(CameraPoses),
            "trajectory": self.upstream(TrajectoryFrames),
        }
        if self.format == "cameras":
            return needed
        needed["field"] = self.upstream(RadianceField)
        for style in self.styles:
            needed[f"stylized {style}"] = self.upstream(StylizedField, style=style)
        return needed

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the format, and the names of the files."""
        return {"format": self.format, "styles": list(self.styles)}

    def external_digests(self) -> Mapping[str, str]:
        """Returns the releases of the packages that write the files."""
        return export_versions(self.format)

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Writes the files."""
        from styletrf.steps.scene_export import export_scene

        export_scene(
            inputs,
            out,
            {},
            self.step_run(run),
            file_format=cast("Any", self.format),
            styles=self.styles,
        )

    @property
    def folder(self) -> Path:
        """Returns the folder of the files."""
        return Path(out_root(), self.scene, "export", self.format)

    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns the files; beside cameras the images that they name, and frames with depths."""
        own = place(self)
        if self.format == "cameras":
            images = place(self.upstream(CameraPoses)) / "images"
            frames = place(self.upstream(TrajectoryFrames)) / "frames"
            files = {name: own / name for name in (self.page, *_CAMERA_FILES)}
            return {**files, "images": images, "frames": frames}
        looks = [f"{look}.{_SUFFIXES[self.format]}" for look in (PHOTOGRAPHS, *self.styles)]
        names = (self.page, *looks, *_BESIDE.get(self.format, ()))
        return {name: own / name for name in names}
