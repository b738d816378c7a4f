"""Lists the warnings of a capture: photographs, masks and poses that are not used."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from styletrf.capture.mask_files import FoundMasks
from styletrf.capture.panorama.panorama_views import DIRECTIONS
from styletrf.capture.photographs import (
    FOREIGN_SUFFIXES,
    VIDEO_SUFFIXES,
    dangling_links,
    files_below,
    natural_order,
    photographs_below,
)
from styletrf.capture.poses.given_poses import GivenPoses

_MOST_NAMES = 10


def capture_warnings(
    folder: Path,
    problems: Sequence[str],
    repeated: Sequence[Path],
    masks: FoundMasks,
    panoramas: tuple[int, int],
    given: GivenPoses | None,
    videos: Sequence[Path] = (),
) -> list[str]:
    """Returns the warnings, a line each.

    Args:
        folder: Contains the photographs.
        problems: The photographs that cannot be used, each with the reason.
        repeated: Files that show the same picture as another one.
        masks: Those found for the photographs.
        panoramas: How many of how many photographs are panoramas.
        given: The poses that came with the photographs.
        videos: Those of the scene that lie elsewhere than in the folder.
    """
    return [
        *(f"left out: {problem}" for problem in problems),
        *_of_other_files(folder, videos),
        *_of_repeated(repeated),
        *warnings_of_masks(masks, "photograph"),
        *_of_panoramas(*panoramas),
        *_of_poses(folder, given),
    ]


def _of_other_files(folder: Path, videos: Sequence[Path]) -> Iterator[str]:
    if dangling := [path.name for path in dangling_links(folder)]:
        yield f"links that lead nowhere: {listed(dangling)}"
    if foreign := [path.name for path in files_below(folder, FOREIGN_SUFFIXES)]:
        yield f"passed over, to be converted first: {listed(foreign)}"
    shots = {(file.parent, file.stem.casefold()) for file in photographs_below(folder)}
    clips = [
        path.name
        for path in dict.fromkeys([*files_below(folder, VIDEO_SUFFIXES), *videos])
        if (path.parent, path.stem.casefold()) not in shots
    ]
    if clips:  # but not those that phones store with each photograph
        yield f"passed over, since there are photographs: {listed(clips)}"


def _of_repeated(files: Sequence[Path]) -> Iterator[str]:
    if files:
        names = listed([file.name for file in files])
        yield f"left out, since another file shows the same: {names}"


def warnings_of_masks(masks: FoundMasks, masked: str) -> Iterator[str]:
    """Yields a line that names the masks that fit nothing, if there are any.

    Args:
        masks: Those found for the photographs or clips.
        masked: What they are found for, such as `photograph`.
    """
    if names := [str(mask.relative_to(masks.folder.parent)) for mask in masks.unused]:
        yield f"masks that fit no {masked} (docs/captures.md): {listed(names)}"


def _of_panoramas(count: int, of_all: int) -> Iterator[str]:
    if count:
        of_them = f"{count} of {of_all} photographs"
        yield f"{of_them} are panoramas: {len(DIRECTIONS)} views are cut from each"


def _of_poses(folder: Path, given: GivenPoses | None) -> Iterator[str]:
    if given is None:
        return
    used = {view.file.resolve() for view in given.views}
    below = photographs_below(folder)
    if any(view.held_out is not None for view in given.views):
        below = [path for path in below if path.parent == folder]  # published splits leave some out
    others = [str(path.relative_to(folder)) for path in below if path.resolve() not in used]
    if given.missing:
        yield f"{given.name} names photographs that are missing: {listed(given.missing)}"
    if others:
        yield f"{given.name} has no poses of: {listed(others)}"


def listed(names: Iterable[str]) -> str:
    """Returns the first ten names in natural order, and how many more there are."""
    ordered = sorted(names, key=natural_order)
    more = len(ordered) - _MOST_NAMES
    return ", ".join(ordered[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
