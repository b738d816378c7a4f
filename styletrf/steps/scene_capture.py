"""The capture of a scene: photographs as they are, or frames of videos."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.capture.clips.video_capture import capture_videos
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.scene_capture import CaptureConfig, capture_photographs
from styletrf.capture.user_folders import (
    find_scene,
    scene_folder,
    scene_videos,
    skipped_photographs,
)
from styletrf.configuration import configured
from styletrf.progress import Progress


def capture_scene(
    data: Path, scene: str, out: Path, settings: Mapping[str, Any], progress: Progress
) -> None:
    """Writes `images/` and `capture.json` of a scene in `data/scenes`.

    Raises:
        InputError: There is no such scene, or it cannot be used.
    """
    found = find_scene(data, scene)
    config = configured(CaptureConfig, settings)
    if videos := scene_videos(found):
        skipped = [photograph.name for photograph in skipped_photographs(data, scene)]
        capture_videos(
            videos, out, config.video_frames, progress, config.panoramas, config.leave_out, skipped
        )
    else:
        given = find_given_poses(scene_folder(found))
        capture_photographs(found, out, progress, given, config.leave_out, config.panoramas)
