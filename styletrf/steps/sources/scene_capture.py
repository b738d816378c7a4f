"""The capture of a scene: photographs as they are, or frames of videos."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.capture.clips.video_capture import capture_videos
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.scene_capture import CaptureConfig, capture_photographs
from styletrf.capture.user_folders import (
    find_scene,
    masks_of_videos,
    scene_folder,
    scene_videos,
    skipped_photographs,
    skipped_videos,
)
from styletrf.configuration import configured
from styletrf.steps.step_run import StepRun


def capture_scene(
    inputs: Mapping[str, Path],
    out: Path,
    settings: Mapping[str, Any],
    run: StepRun,
    *,
    data: Path,
    scene: str,
) -> None:
    """Writes `images/`, `masks/` if there are any, and `capture.json` of a scene of the user.

    Args:
        inputs: Empty.
        out: The folder to fill.
        settings: Those of `CaptureConfig`.
        run: Its progress is the number of photographs or frames.
        data: The user's folder, which contains `scenes/`.
        scene: A folder or a video in `scenes/`.

    Raises:
        InputError: There is no such scene, or it cannot be used.
    """
    found = find_scene(data, scene)
    config = configured(CaptureConfig, settings)
    if videos := scene_videos(found):
        skipped = [photograph.name for photograph in skipped_photographs(data, scene)]
        capture_videos(
            videos,
            out,
            config.video_frames,
            run.progress,
            config.panoramas,
            config.leave_out,
            skipped,
            masks_of_videos(data, scene),
        )
    else:
        given = find_given_poses(scene_folder(found))
        capture_photographs(
            found,
            out,
            run.progress,
            given,
            config.leave_out,
            config.panoramas,
            skipped_videos(data, scene),
        )
