"""Finds the mask of each photograph, and of each clip.

The mask of `images/walk/1.jpg` is `masks/walk/1.png` or `masks/walk/1.jpg.png`. The folder `masks`
is beside `images` or in it, or beside the photograph itself. Suffixes may be in upper or lower
case. If the masks have no folders, or the photographs have none, the name alone decides. Then only
one photograph may have this name, and no photograph may be in the folder that the mask's path
names.

The mask of a clip has such a name, too. It is a video, or a folder of PNG files. Of clips whose
names differ in the suffix alone, a mask has the whole name: `1.mov` or `1.mov.mp4` masks `1.mov`.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from styletrf.capture.masks import MASKS
from styletrf.capture.photograph_names import composed
from styletrf.capture.photographs import (
    PHOTOGRAPH_SUFFIXES,
    VIDEO_SUFFIXES,
    is_of_scene,
    path_below,
    require_readable_name,
)
from styletrf.files.linked_folders import walk

_PNG = ".png"
_SUFFIXES = PHOTOGRAPH_SUFFIXES | VIDEO_SUFFIXES

Masked = tuple[Path, Path]
"""A mask, which is a file or a folder, and the name of what it masks."""


@dataclass(frozen=True, slots=True)
class FoundMasks:
    """The masks of a scene by their photographs or clips, and the files that fit none.

    `files` are all files of masks; `folder` is that of the photographs or clips.
    """

    folder: Path
    files: tuple[Path, ...]
    by_picture: Mapping[Path, Path]
    unused: tuple[Path, ...]


NO_MASKS = FoundMasks(Path(), (), {}, ())


def find_masks(photographs: Path, files: Sequence[Path]) -> FoundMasks:
    """Returns the masks of photographs, each a PNG file, and those that fit none.

    Args:
        photographs: The folder of the photographs.
        files: All photographs of the scene, also those that are not used.

    Raises:
        InputError: The path of a mask below its folder is not in UTF-8.
    """
    names = {file: _mask_names(path_below(photographs, file)) for file in files}
    return _found(photographs, names, _of_photograph)


def find_clip_masks(folder: Path, clips: Sequence[Path]) -> FoundMasks:
    """Returns the masks of clips, each a video or a folder of PNG files, and what fits no clip.

    Args:
        folder: That of the clips, or that of the scene if its one clip lies beside it.
        clips: All clips of the scene.

    Raises:
        InputError: The path of a mask below its folder is not in UTF-8.
    """
    names = {clip: _mask_names(path_below(folder, clip)) for clip in clips}
    times = Counter(without_suffix for without_suffix, _ in names.values())
    names = {clip: of_clip[times[of_clip[0]] > 1 :] for clip, of_clip in names.items()}
    whole = {of_clip[0] for of_clip in names.values() if len(of_clip) == 1}
    return _found(folder, names, partial(_of_clip, whole=whole))


def _found(
    folder: Path,
    names: Mapping[Path, Sequence[Path]],
    mask_and_name: Callable[[Path, Path], Masked | None],
) -> FoundMasks:
    """Returns the masks of pictures, and the files that fit none.

    Args:
        folder: That of the pictures.
        names: The names that the mask of each picture may have.
        mask_and_name: Returns the mask that a file is, or is a part of, and the name of that mask.
    """
    masks = mask_files(folder)
    pairs = ((file, mask_and_name(file, place)) for file, place in masks.items())
    mask_of = {file: pair for file, pair in pairs if pair}
    name_of = dict(mask_of.values())
    in_own = _in_own_folders(name_of, names)
    left = {mask: name for mask, name in name_of.items() if mask not in in_own.values()}
    found = _in_other_folders(left, names) | in_own
    used = {file for file, (mask, _) in mask_of.items() if mask in found.values()}
    return FoundMasks(folder, tuple(masks), found, tuple(m for m in masks if m not in used))


def mask_files(photographs: Path) -> dict[Path, Path]:
    """Returns all masks of a scene, each with the path below `photographs` that it has in `masks`.

    Args:
        photographs: The folder of the photographs.

    Raises:
        InputError: The path of a mask below its folder is not in UTF-8.
    """
    found = {}
    for folder, base in _mask_folders(photographs):
        files = (inside / name for inside, _, names in walk(folder) for name in names)
        for mask in sorted(files, key=lambda path: (path.suffix != _PNG, path)):
            place = mask.relative_to(folder)
            is_hidden = any(part.startswith(".") for part in place.parts)
            if not is_hidden and mask.suffix.lower() in _SUFFIXES and mask.is_file():
                require_readable_name(str(place))
                found[mask] = base / place
    return found


def _mask_folders(photographs: Path) -> Iterator[tuple[Path, Path]]:
    """Yields each folder of masks, and where below `photographs` those lie that it masks."""
    beside = sorted(photographs.parent.iterdir()) if photographs.name == "images" else []
    inside = sorted(place / name for place, folders, _ in walk(photographs) for name in folders)
    for folder in [*beside, *inside]:
        if folder.name.casefold() != MASKS or not folder.is_dir():
            continue
        if folder.parent == photographs.parent:
            yield folder, Path()
        elif is_of_scene(folder.with_name("any"), photographs):
            yield folder, folder.parent.relative_to(photographs)


def _in_own_folders(
    masked: Mapping[Path, Path], names: Mapping[Path, Sequence[Path]]
) -> dict[Path, Path]:
    """Returns the masks that lie in `masks` as their photographs do beside it."""
    first: dict[Path, Path] = {}
    for mask, name in masked.items():
        first.setdefault(name, mask)
    pairs = ((file, [first[n] for n in of_file if n in first]) for file, of_file in names.items())
    return {file: masks[0] for file, masks in pairs if masks}


def _in_other_folders(
    masked: Mapping[Path, Path], names: Mapping[Path, Sequence[Path]]
) -> dict[Path, Path]:
    """Returns the masks whose name only one photograph has, unless a folder says otherwise."""
    folders = {of_file[0].parent for of_file in names.values()}
    masks = _only_ones((name.name, mask) for mask, name in masked.items())
    files = _only_ones((name.name, file) for file, of_file in names.items() for name in of_file)
    return {
        files[name]: mask
        for name, mask in masks.items()
        if name in files
        and (folder := masked[mask].parent) not in folders
        and Path() in (folder, names[files[name]][0].parent)
    }


def _only_ones(pairs: Iterable[tuple[str, Path]]) -> dict[str, Path]:
    """Returns the files whose name no other file has, by name."""
    named = set(pairs)
    times = Counter(name for name, _ in named)
    return {name: file for name, file in named if times[name] == 1}


def _mask_names(place: Path) -> list[Path]:
    """Returns the two names that the mask of a photograph may have, without the mask's suffix."""
    return [_compared(place.with_suffix("")), _compared(place)]


def _of_photograph(mask: Path, place: Path) -> Masked | None:
    """Returns a file, and the one of these names that it has; None where it is not a PNG."""
    return (mask, _compared(place.with_suffix(""))) if place.suffix.lower() == _PNG else None


def _of_clip(mask: Path, place: Path, whole: Set[Path]) -> Masked | None:
    """Returns a video, or the folder of a PNG, and its name; None where it is neither.

    Args:
        mask: The file.
        place: Its path below the folder of masks.
        whole: Names of clips with their suffix, where a name without it is not that of one clip.
    """
    if place.suffix.lower() in VIDEO_SUFFIXES:
        name = _compared(place)
        return mask, name if name in whole else name.with_suffix("")
    is_in_folder = place.suffix.lower() == _PNG and mask.parent.name.casefold() != MASKS
    return (mask.parent, _compared(place.parent)) if is_in_folder else None


def _compared(path: Path) -> Path:
    """Returns a name as it is typed, and the suffix of a picture in lower case."""
    path, suffix = Path(composed(str(path))), path.suffix.lower()
    return path.with_suffix(suffix) if suffix in _SUFFIXES else path
