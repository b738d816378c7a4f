"""The number and size of a scene's photographs, read from its folder."""

import json
import sys
from contextlib import suppress
from dataclasses import asdict

from pipeline.settings import data_root
from styletrf.capture.panorama.panorama_views import DIRECTIONS
from styletrf.capture.panorama.panoramas import find_panoramas
from styletrf.capture.photograph_size import first_size
from styletrf.capture.photographs import list_photographs
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.user_folders import find_scene, scene_folder, scene_videos
from styletrf.errors import InputError
from styletrf.files.video_frames import declared_frames, first_frame
from tasks.planning.memory_demand import LONGEST_PX, Photographs

_VIDEO_FRAMES = 60


def photographs_of(scene: str, video_frames: int) -> Photographs | None:
    """Returns the photographs of a scene; None if they cannot be read, which its stage reports.

    All count as large as the first one; a panorama counts as square views.
    """
    with suppress(InputError):
        found = find_scene(data_root(), scene)
        if videos := scene_videos(found):
            height, width, _ = first_frame(videos[0]).pixels.shape
            filmed = width * height * sum(map(declared_frames, videos))
            return Photographs(video_frames, width, height, filmed)
        given = find_given_poses(scene_folder(found))
        files = [view.file for view in given.views] if given else list_photographs(found)
        width, height = first_size(files)
        if not given and find_panoramas({files[0]: (width, height)}, "auto"):
            return Photographs(len(DIRECTIONS) * len(files), LONGEST_PX, LONGEST_PX)
        return Photographs(len(files), width, height)
    return None


def main() -> int:
    """Reads the names of scenes, and writes their photographs as the last line, both as JSON."""
    photographs = {scene: photographs_of(scene, _VIDEO_FRAMES) for scene in json.load(sys.stdin)}
    text = json.dumps({s: asdict(found) for s, found in photographs.items() if found})
    sys.stdout.write(f"\n{text}\n")  # a library may have written half a line
    return 0
