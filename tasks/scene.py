"""From photographs to the model of their scene."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import luigi

from pipeline.digest import file_digest
from pipeline.settings import data_root
from pipeline.task import RunContext
from tasks.stage import Stage, TunedStage


class SceneCapture(TunedStage):
    """The user's photographs, checked and kept as they are, or frames of the user's videos.

    Leaves `images/` and `capture.json`; made anew when a photograph changes.
    """

    scene = luigi.Parameter(description="a folder in data/scenes, or a video there")
    tools = ("av", "opencv-contrib-python-headless", "pycolmap")

    def external_digests(self) -> Mapping[str, str]:
        """The digest of each photograph and file of poses, or of each video."""
        from styletrf.capture.user_folders import find_scene, scene_files, scene_folder

        found = find_scene(data_root(), self.scene)
        below = scene_folder(found)
        return {str(path.relative_to(below)): file_digest(path) for path in scene_files(found)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Check and copy the photographs, or choose frames."""
        from styletrf.capture.clips.video_capture import capture_videos
        from styletrf.capture.poses.pose_formats import find_given_poses
        from styletrf.capture.scene_capture import CaptureConfig, capture_photographs
        from styletrf.capture.user_folders import find_scene, scene_folder, scene_videos
        from styletrf.configuration import configured

        found = find_scene(data_root(), self.scene)
        config = configured(CaptureConfig, self.values())
        if videos := scene_videos(found):
            capture_videos(videos, out, config.video_frames, run.progress, config.panoramas)
        else:
            given = find_given_poses(scene_folder(found))
            capture_photographs(found, out, run.progress, given, config.leave_out, config.panoramas)


class CameraPoses(TunedStage):
    """Poses, intrinsics, sparse points and undistorted images, by COLMAP.

    Leaves `cameras.parquet`, `points.parquet`, `images/NAME.png` and `poses.json`. COLMAP's own
    messages lie beside the log.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    tools = ("opencv-contrib-python-headless", "pycolmap")

    def requires(self) -> Mapping[str, Stage]:
        """The photographs."""
        return {"capture": self.need(SceneCapture)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Solve for the cameras."""
        from styletrf.configuration import configured
        from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses

        config = configured(CameraPosesConfig, self.values())
        work = run.resume / "colmap"
        shutil.rmtree(work, ignore_errors=True)  # what a killed build left
        work.mkdir()
        solve_camera_poses(
            inputs["capture"], out, config, run.progress, run.log.with_suffix(".colmap"), work
        )


class SceneModel(TunedStage):
    """The space, box, near and far, resolution and working size that the scene requires.

    Photographs held out have no part in it. Leaves `scene.json`, each decision with its evidence.
    """

    scene = luigi.Parameter(description="a folder in data/scenes")
    tools = ("numba", "opencv-contrib-python-headless")

    def requires(self) -> Mapping[str, Stage]:
        """The cameras and the points."""
        return {"poses": self.need(CameraPoses)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Decide from the photographs that are not held out."""
        from styletrf.configuration import configured
        from styletrf.scene.scene_model import SceneModelConfig, write_scene_model
        from styletrf.scene.training_photographs import (
            model_of_photographs,
            read_training_photographs,
        )

        photographs = read_training_photographs(inputs["poses"])
        model = model_of_photographs(photographs, configured(SceneModelConfig, self.values()))
        write_scene_model(out / "scene.json", model)
