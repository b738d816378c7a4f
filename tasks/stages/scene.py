"""From photographs to the model of their scene."""

from collections.abc import Mapping
from pathlib import Path

from pipeline.digest import file_digest
from pipeline.parameters import NameParameter
from pipeline.settings import data_root
from pipeline.task import RunContext
from tasks.stages.stage import ConfigurableStage, Stage


class SceneCapture(ConfigurableStage):
    """The user's photographs, checked and copied unchanged, or frames of the user's videos.

    Leaves `images/` and `capture.json`; a changed photograph leads to a new capture.
    """

    scene = NameParameter(description="a folder in data/scenes, or a video there")
    tools = ("av", "opencv-contrib-python-headless", "pycolmap")

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digest of each photograph, file of poses and video, and of their masks.

        Warnings name photographs and videos that are skipped, so they are in it as well.
        """
        from styletrf.capture.user_folders import (
            find_scene,
            masks_of_videos,
            scene_files,
            scene_folder,
            scene_videos,
            skipped_photographs,
            skipped_videos,
        )

        found, scenes = find_scene(data_root(), self.scene), data_root() / "scenes"
        below = scene_folder(found)
        digests = {str(path.relative_to(below)): file_digest(path) for path in scene_files(found)}
        if masks := masks_of_videos(data_root(), self.scene).files:
            for path in masks:
                digests[f"masks/{path.relative_to(scenes)}"] = file_digest(path)
            for path in scene_videos(found):  # their folders decide which mask is whose
                digests[f"masked/{path.relative_to(scenes)}"] = "by name"
        for path in skipped_photographs(data_root(), self.scene):
            digests[f"skipped/{path.relative_to(scenes)}"] = file_digest(path)
        for path in skipped_videos(data_root(), self.scene):  # large: only the name is used
            digests[f"skipped/{path.relative_to(scenes)}"] = "by name"
        return digests

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Checks and copies the photographs, or chooses frames."""
        from styletrf.steps.sources.scene_capture import capture_scene

        capture_scene(
            inputs, out, self.values(), self.step_run(run), data=data_root(), scene=self.scene
        )


class CameraPoses(ConfigurableStage):
    """Poses, intrinsics, sparse points and undistorted images, by COLMAP.

    Leaves `cameras.parquet`, `points.parquet`, `images/NAME.png` and `poses.json`. COLMAP's own
    messages lie beside the log.
    """

    scene = NameParameter(description="a folder in data/scenes")
    tools = ("numba", "opencv-contrib-python-headless", "pycolmap", "torch")

    def requires(self) -> Mapping[str, Stage]:
        """Returns the photographs."""
        return {"capture": self.upstream(SceneCapture)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Solves for the cameras."""
        from styletrf.steps.camera_poses import solve_poses

        solve_poses(inputs, out, self.values(), self.step_run(run))


class SceneModel(ConfigurableStage):
    """The space, box, near and far, resolution and working size that the scene requires.

    Photographs held out have no part in it. Leaves `scene.json`, each decision with its evidence.
    """

    scene = NameParameter(description="a folder in data/scenes")
    tools = ("numba", "opencv-contrib-python-headless")

    def requires(self) -> Mapping[str, Stage]:
        """Returns the cameras and the points."""
        return {"poses": self.upstream(CameraPoses)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Decides from the photographs that are not held out."""
        from styletrf.steps.scene_model import decide_model

        decide_model(inputs, out, self.values(), self.step_run(run))
