"""The names that photographs get in a capture, before it is made."""

from collections.abc import Iterable, Iterator, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from styletrf.capture.clips.video_capture import frame_prefixes
from styletrf.capture.left_out import left_out, names_of_frame, without
from styletrf.capture.panorama.panoramas import Choice, find_panoramas, has_panorama_shape
from styletrf.capture.photograph_names import (
    photograph_names,
    stored_files,
    views_of_panorama,
)
from styletrf.capture.photographs import list_photographs, read_photograph
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.scene_capture import CaptureConfig
from styletrf.capture.user_folders import scene_folder, scene_videos
from styletrf.errors import InputError


@dataclass(frozen=True, slots=True)
class ExpectedNames:
    """The names of a scene's photographs, and whether poses came with them."""

    names: tuple[str, ...]
    poses_are_given: bool = False


def expected_names(found: Path, config: CaptureConfig, asked: Set[str]) -> ExpectedNames:
    """Returns the names that the capture of a scene will give.

    Only the names in `asked` are certain, so that not all photographs have to be read: others may
    be damaged, and are left out then. For videos these are the names that frames may get, and views
    that are cut from them: the number of frames that differ is not known before they are chosen.

    Args:
        found: The folder or video that `find_scene` returned.
        config: The settings of the capture.
        asked: Names that may be among them.

    Raises:
        InputError: The scene cannot be captured.
    """
    if videos := scene_videos(found):
        return ExpectedNames(tuple(_names_of_frames(videos, config)))
    given = find_given_poses(scene_folder(found))
    taken = [view.file for view in given.views] if given else list_photographs(found)
    files = without(found, taken, config.leave_out)
    choice = "no" if given or not asked else config.panoramas
    return ExpectedNames(tuple(_names(files, choice, asked)), given is not None)


def _names(files: Sequence[Path], choice: Choice, asked: Set[str]) -> list[str]:
    named = dict(zip(files, photograph_names(stored_files(files)), strict=True))
    meant = [file for file, name in named.items() if asked & {name, *views_of_panorama(name)}]
    sizes = _sizes_of(meant)
    cut = _panoramas(files, sizes, choice)
    damaged = set(meant) - sizes.keys()
    return [
        view
        for file, name in named.items()
        if file not in damaged
        for view in (views_of_panorama(name) if file in cut else [name])
    ]


def _names_of_frames(videos: Sequence[Path], config: CaptureConfig) -> Iterator[str]:
    numbers = range(1, config.video_frames + 1)
    names = [f"{prefix}{k:04d}" for prefix in frame_prefixes(videos) for k in numbers]
    gone = left_out(config.leave_out, [names_of_frame(name) for name in names])
    for index, name in enumerate(names):
        if index not in gone and config.panoramas != "yes":
            yield name
        if index not in gone and config.panoramas != "no":
            yield from views_of_panorama(name)


def _sizes_of(files: Iterable[Path]) -> dict[Path, tuple[int, int]]:
    """Returns width and height of those photographs that can be read."""
    sizes = {}
    for file in files:
        with suppress(InputError):
            height, width, _ = read_photograph(file).shape
            sizes[file] = width, height
    return sizes


def _panoramas(
    files: Sequence[Path], sizes: dict[Path, tuple[int, int]], choice: Choice
) -> set[Path]:
    """Returns which photographs are cut; all are read only where one has a panorama's shape."""
    if choice != "auto":
        return set(files) if choice == "yes" else set()
    looked_at = sizes or _sizes_of(files[:1])
    if not any(has_panorama_shape(*size) for size in looked_at.values()):
        return set()
    return find_panoramas(_sizes_of(files), choice)
