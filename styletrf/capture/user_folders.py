"""The folders of users under one root: `scenes/NAME/images/*`, `styles/NAME.jpg`, `content/*`.

A name that leads nowhere is answered with the names that lead somewhere.
"""

import re
from collections.abc import Iterable, Set
from pathlib import Path

from styletrf.capture.known_scenes import download_instructions
from styletrf.capture.mask_files import NO_MASKS, FoundMasks, find_clip_masks, mask_files
from styletrf.capture.photograph_names import composed
from styletrf.capture.photographs import (
    FEWEST_PHOTOGRAPHS,
    MORE_PHOTOGRAPHS,
    PHOTOGRAPH_SUFFIXES,
    VIDEO_SUFFIXES,
    files_below,
    folder_of_pictures,
    list_photographs,
    natural_order,
    photographs_below,
    require_readable_name,
    too_few,
)
from styletrf.capture.poses.colmap_folders import colmap_files
from styletrf.capture.poses.transforms_frames import transforms_photographs
from styletrf.content.content_sources import CONTENT_SUFFIXES
from styletrf.errors import InputError
from styletrf.files.linked_folders import walk_files

_POSES = ("poses_bounds.npy", "transforms*.json", "sparse/**/*.*", "colmap/sparse/**/*.*")
"""Files of the formats that `pose_formats` reads."""
_NAME = re.compile(r"[^./\\\x00-\x1f][^/\\\x00-\x1f]*")


def find_scene(data_root: Path, name: str) -> Path:
    """Returns the folder of a scene's photographs or videos, or the one video of it.

    The folder is `data_root/scenes/NAME/images`, or, where that holds neither, `NAME` itself, with
    the photographs or videos in it or in folders in it; a video may also be
    `data_root/scenes/NAME.mp4` (or .mov and so on). With three photographs or more, videos are
    passed over; with fewer beside videos, these are.

    Raises:
        InputError: The name is not one of a plain folder or is `images`, several videos beside each
            other or beside a folder of them share it, the folder holds no photograph, the name of
            a picture is not in UTF-8, or there is no such scene; it lists the scenes that exist
            and, for a well-known public one, says where to get it.
    """
    _check_name("scene", name)
    if name == "images":  # `scene_folder` would be that of all scenes
        problem = "is the name of the folder of photographs within a scene"
        raise InputError(f"scene {name!r}", problem, "Rename the scene")
    scenes = data_root / "scenes"
    own = _scene_named(scenes, name)
    images = own / "images"
    folder = folder_of_pictures(own)
    if _is_of_photographs(folder):
        return folder
    if videos := _found_videos(scenes, folder, name):
        return videos
    if any((own / f"transforms{part}.json").exists() for part in ("", "_train")):
        return own  # photographs lie where the transforms say
    if photographs_below(folder):
        return folder  # `list_photographs` says that they are too few
    if images.is_dir():
        return images
    if own.is_dir() and any(own.iterdir()):
        raise InputError(f"scene {name!r}", too_few(own, 0) + f" in {own}", MORE_PHOTOGRAPHS)
    raise _no_such_scene(data_root, name)


def _scene_named(scenes: Path, name: str) -> Path:
    """Returns the folder of a scene, whether or not there is one."""
    own, typed = scenes / name, composed(name)
    if own.exists() or name.isascii():
        return own
    alike = (path for path in scenes.glob("*") if composed(path.name) == typed)
    return next((path for path in alike if path.is_dir()), own)


def _named(paths: Iterable[Path], name: str) -> list[Path]:
    """Returns the files with a name, with or without its suffix.

    If no name is exactly the same, it returns those whose accents are stored in another form.
    """
    files, typed = list(paths), composed(name)
    exact = [path for path in files if name in (path.stem, path.name)]
    return exact or [p for p in files if typed in (composed(p.stem), composed(p.name))]


def _is_of_photographs(folder: Path) -> bool:
    return len(photographs_below(folder)) >= FEWEST_PHOTOGRAPHS


def _found_videos(scenes: Path, folder: Path, name: str) -> Path | None:
    """Returns the one video of a scene, or the folder of its several; None where it has none."""
    beside = _videos_beside(scenes, name)
    inside = [video for video in scene_videos(folder) if video not in beside]
    if len(beside) + bool(inside) > 1:
        names = ", ".join(sorted(video.name for video in [*beside, *inside]))
        remedy = f"Put all clips of the scene into scenes/{name}, the others elsewhere"
        raise InputError(f"scene {name!r}", f"has several videos: {names}", remedy)
    if not beside and not inside:
        return None
    return folder if len(inside) > 1 else (beside or inside)[0]


def _videos_beside(scenes: Path, name: str) -> list[Path]:
    """Returns the videos beside the folder of a scene that have its name."""
    videos = (path for path in scenes.glob("*") if path.suffix.lower() in VIDEO_SUFFIXES)
    return [path for path in _named(videos, name) if path.is_file()]


def _no_such_scene(data_root: Path, name: str) -> InputError:
    scenes = data_root / "scenes"
    existing = [
        path.name if path.is_dir() else path.stem
        for path in scenes.glob("*")
        if path.is_dir() or _of_suffix([path], VIDEO_SUFFIXES)
    ]
    remedy = (
        download_instructions(name)
        or f"Put its photographs into scenes/{name}/images, or a video as scenes/{name}.mp4,"
    )
    problem = _missing(scenes, existing)
    return InputError(f"scene {name!r}", problem, f"{remedy} under {data_root}")


def scene_folder(photographs: Path) -> Path:
    """Returns the folder of a scene, where poses may lie, from the result of `find_scene`."""
    is_inside = photographs.name == "images" or not photographs.is_dir()
    return photographs.parent if is_inside else photographs


def scene_videos(found: Path) -> list[Path]:
    """Returns the videos of a scene in natural order; none if `find_scene` found photographs.

    Raises:
        InputError: As `files_below`.
    """
    if not found.is_dir():
        return _of_suffix([found], VIDEO_SUFFIXES)
    return [] if _is_of_photographs(found) else files_below(found, VIDEO_SUFFIXES)


def skipped_photographs(data_root: Path, name: str) -> list[Path]:
    """Returns the photographs of a scene that is read from its videos, as they are too few.

    Raises:
        InputError: As `find_scene` does.
    """
    if not scene_videos(find_scene(data_root, name)):
        return []
    return photographs_below(folder_of_pictures(_scene_named(data_root / "scenes", name)))


def skipped_videos(data_root: Path, name: str) -> list[Path]:
    """Returns the videos of a scene that is read from its photographs, wherever they lie.

    Raises:
        InputError: As `find_scene` does.
    """
    if scene_videos(find_scene(data_root, name)):
        return []
    scenes = data_root / "scenes"
    own = _scene_named(scenes, name)
    return [*files_below(own, VIDEO_SUFFIXES), *_videos_beside(scenes, name)]


def masks_of_videos(data_root: Path, name: str) -> FoundMasks:
    """Returns the masks of a scene that is read from its videos; none of one with photographs.

    Raises:
        InputError: As `find_scene` does, or the path of a mask is not in UTF-8.
    """
    found, scenes = find_scene(data_root, name), data_root / "scenes"
    if not (videos := scene_videos(found)):
        return NO_MASKS
    is_beside = found.parent == scenes and not found.is_dir()
    own = _scene_named(scenes, found.stem if is_beside else name)
    return find_clip_masks(folder_of_pictures(own), videos)


def scene_files(found: Path) -> list[Path]:
    """Returns the files of a scene that `find_scene` found: photographs, masks, poses; or videos.

    Raises:
        InputError: There are too few photographs, poses name one outside the scene's folder, or a
            name is not in UTF-8.
    """
    folder, files = scene_folder(found), scene_videos(found) or _photographs_and_poses(found)
    for path in files:
        require_readable_name(str(path.relative_to(folder)))
    return files


def _photographs_and_poses(found: Path) -> list[Path]:
    """Returns the files of a scene of photographs, each once."""
    folder = scene_folder(found)
    poses = [path for pattern in _POSES for path in sorted(folder.glob(pattern)) if path.is_file()]
    poses += colmap_files(folder)
    if any(path.suffix == ".json" for path in poses):  # which names photographs anywhere below
        images = sorted(_of_suffix(walk_files(folder), PHOTOGRAPH_SUFFIXES))
        photographs = [*images, *transforms_photographs(folder)]
    else:
        photographs = list_photographs(found)
    return list(dict.fromkeys([*photographs, *mask_files(found), *poses]))


def find_style(data_root: Path, name: str) -> Path:
    """Returns a style's image, `data_root/styles/NAME.*`; NAME may carry the suffix itself.

    Raises:
        InputError: The name is not one of a plain file, two images share it, or there is no such
            style; lists the styles that exist.
    """
    _check_name("style", name)
    styles = data_root / "styles"
    files = [path for path in styles.glob("*") if path.is_file() and path.name[0] != "."]
    images = [path for path in files if path.suffix.lower() in PHOTOGRAPH_SUFFIXES]
    found = sorted(_named(images, name))
    if len(found) == 1:
        require_readable_name(found[0].name)
        return found[0]
    if found:
        names = ", ".join(path.name for path in found)
        raise InputError(f"style {name!r}", f"several images share it: {names}", "Give one in full")
    others = [path.name for path in _named(files, name)]
    problem = f"{others[0]} is not an image" if others else "there is no such style"
    existing = [path.stem for path in images]
    remedy = f"Put a JPEG or PNG image into {styles} as {Path(name).stem}.jpg or .png"
    raise InputError(f"style {name!r}", _missing(styles, existing, problem), remedy)


def first_style(data_root: Path) -> str:
    """Returns the name of the first style image by name, its accents as `composed` has them.

    Raises:
        InputError: There is no style.
    """
    files = (path for path in (data_root / "styles").glob("[!.]*") if path.is_file())
    images = sorted(_of_suffix(files, PHOTOGRAPH_SUFFIXES))
    if not images:
        find_style(data_root, "any")  # which says what to do
    return composed(images[0].stem)


def find_content(data_root: Path, name: str) -> Path | None:
    """Returns the photographs that a style network is to be trained on; None is the embedded set.

    Args:
        data_root: The folder of `content/`.
        name: `embedded`; `auto`, for the only folder with images, zip or annotations file there,
            or else `embedded`; the name of one of these; or the path of one that lies elsewhere.

    Raises:
        InputError: `auto` finds several.
    """
    content = data_root / "content"
    if name not in ("auto", "embedded"):
        return content / name if (content / name).exists() else Path(name)
    if name == "embedded" or not content.is_dir():
        return None
    entries = sorted(content.glob("[!.]*"), key=lambda path: natural_order(path.name))
    found = [path for path in entries if path.suffix.lower() in (".zip", ".json")]
    found += [
        path for path in entries if path.is_dir() and _of_suffix(walk_files(path), CONTENT_SUFFIXES)
    ]
    if _of_suffix(entries, CONTENT_SUFFIXES):
        found.append(content)
    if len(found) > 1:
        names = ", ".join("the images beside them" if p == content else p.name for p in found)
        remedy = f"Choose one with --content NAME, such as --content {found[0].name}"
        raise InputError("--content auto", f"{content} holds several: {names}", remedy)
    return found[0] if found else None


def _of_suffix(paths: Iterable[Path], suffixes: Set[str]) -> list[Path]:
    return [path for path in paths if path.suffix.lower() in suffixes and path.is_file()]


def _check_name(kind: str, name: str) -> None:
    require_readable_name(name)
    if not _NAME.fullmatch(name) or ".." in name:
        problem = "it must be a plain name, not empty, without '/' or '..' or a leading dot"
        raise InputError(f"{kind} {name!r}", problem, f"Give the name of a {kind} under data/")


def _missing(folder: Path, existing: list[str], problem: str = "there is no such scene") -> str:
    names = ", ".join(sorted(set(existing), key=natural_order)) or "none"
    return f"{problem} (in {folder} there are: {names})"
