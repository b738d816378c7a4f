"""A scene's photographs, checked and kept as they are: exact copies and `capture.json`.

A photograph that is damaged is left out with a warning while enough of them are whole.
"""

import hashlib
import shutil
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

from styletrf.capture.capture_file import Capture, Photograph, write_capture
from styletrf.capture.left_out import without
from styletrf.capture.mask_files import FoundMasks, find_masks
from styletrf.capture.masks import MASKS, require_mask_of
from styletrf.capture.panorama.panorama_capture import cut_photographs
from styletrf.capture.panorama.panorama_views import DIRECTIONS
from styletrf.capture.panorama.panoramas import Choice, find_panoramas, fraction_of_directions
from styletrf.capture.photograph_names import (
    photograph_names,
    require_own_names,
    stored_files,
)
from styletrf.capture.photographs import (
    FEWEST_PHOTOGRAPHS,
    FOREIGN_SUFFIXES,
    MORE_PHOTOGRAPHS,
    PHOTOGRAPH_SUFFIXES,
    VIDEO_SUFFIXES,
    files_below,
    list_photographs,
    natural_order,
    photographs_below,
    read_photograph,
)
from styletrf.capture.poses.given_poses import (
    GivenPoses,
    GivenView,
    read_given_poses,
    write_given_poses,
)
from styletrf.errors import InputError
from styletrf.progress import Progress, silent

_MOST_NAMES = 10

GIVEN_POSES = "given_poses.json"
"""In a capture, the poses that came with the photographs."""


@dataclass(frozen=True, slots=True)
class CaptureConfig:
    """Which photographs are taken.

    Args:
        video_frames: Of the videos of a scene together, at most so many frames.
        leave_out: Names, paths or patterns such as `IMG_00*` of photographs that are not taken, and
            of frames of videos; see `styletrf.capture.left_out`.
        panoramas: Whether photographs and videos are equirectangular, of all directions, and cut
            into views; `auto` decides from what they say and show.
    """

    video_frames: int = 60
    leave_out: tuple[str, ...] = ()
    panoramas: Choice = "auto"


def capture_photographs(
    folder: Path,
    out_dir: Path,
    progress: Progress = silent,
    given: GivenPoses | None = None,
    leave_out: Sequence[str] = (),
    panoramas: Choice = "auto",
) -> Capture:
    """Checks all photographs of `folder`; copies their bytes and writes `capture.json`.

    `out_dir` receives `images/<file>`, `masks/<name>.png` of those that have one (see
    `styletrf.capture.mask_files`), and, last, `capture.json` (see `read_capture`). A photograph's
    `name` is that of `styletrf.capture.photograph_names`. What is odd about them is logged as a
    warning, too. With poses that are `given`, their photographs alone are taken, and
    `given_poses.json` is written; their lenses are given, too, so that none is looked at as a
    panorama. Other panoramas are replaced by views cut from them.

    Raises:
        InputError: One for all that is wrong: too few photographs, or fewer than half of them
            that can be used, a mask that is none, one named as a view of a panorama, or nothing to
            leave out by such a name. Nothing is written then.
    """
    _require_one_lens_source(folder, given, panoramas)
    taken = [view.file for view in given.views] if given else list_photographs(folder)
    files = without(folder, taken, leave_out)
    examined, problems = _examined(
        files, progress, keeps_sweeps=given is not None or panoramas != "auto"
    )
    _require_enough(folder, len(examined), len(files), problems)
    found = find_masks(folder, list(dict.fromkeys([*taken, *photographs_below(folder)])))
    masks = found.by_photograph
    again = [] if given else _repeated(examined, masks.keys())
    examined = {file: one for file, one in examined.items() if file not in again}
    photographs = list(examined.values())
    if len(photographs) < FEWEST_PHOTOGRAPHS:
        problem = f"only {len(photographs)} of the photographs differ"
        raise InputError(str(folder), problem, MORE_PHOTOGRAPHS)
    for file in masks.keys() & examined.keys():
        require_mask_of(masks[file], examined[file].width, examined[file].height)
    sizes = {file: (one.width, one.height) for file, one in examined.items()}
    cut = find_panoramas(sizes, "no" if given else panoramas)
    require_own_names(examined, cut)
    kept = _stored(examined, masks, cut, out_dir)
    warnings = [f"left out: {problem}" for problem in problems] + _warnings(folder)
    if again:
        names = _listed([file.name for file in again])
        warnings.append(f"left out, since another file shows the same: {names}")
    warnings += _warnings_of_masks(folder, found)
    if cut:
        of_them = f"{len(cut)} of {len(photographs)} photographs"
        warnings.append(f"{of_them} are panoramas: {len(DIRECTIONS)} views are cut from each")
    if given:
        views = {view.file: view for view in given.views}
        named = {photograph.name: views[file] for file, photograph in examined.items()}
        write_given_poses(out_dir / GIVEN_POSES, given.source.name, named)
        warnings += _warnings_of_poses(folder, given)
    capture = Capture(tuple(kept), tuple(warnings))
    write_capture(out_dir, capture)
    return capture


def _repeated(photographs: Mapping[Path, Photograph], masked: Set[Path]) -> list[Path]:
    """Returns the files that show what another one does: that with a mask, or else the first.

    They are exact copies, or of the same folder, stem and size in another format, as telephones and
    cameras keep one shot as HEIC and JPEG. One of two that are the same might be held out, and
    flatter the field that was fitted to the other.
    """
    by_digest: set[str] = set()
    suffixes: dict[object, str] = {}
    found = []
    for file in sorted(photographs, key=lambda file: file not in masked):
        one, suffix = photographs[file], file.suffix.lower().replace("jpeg", "jpg")
        shot = file.parent, file.stem, one.width, one.height
        if one.sha256 in by_digest or suffixes.setdefault(shot, suffix) != suffix:
            found.append(file)
        by_digest.add(one.sha256)
    return found


def _require_one_lens_source(folder: Path, given: GivenPoses | None, panoramas: Choice) -> None:
    """Refuses photographs that are to be panoramas and have poses, which name their lenses."""
    if given and panoramas == "yes":
        problem = "are to be panoramas, but the poses that came with them name their lenses"
        remedy = f"Take {given.source.name} away, or leave the setting panoramas at auto"
        raise InputError(str(folder), problem, remedy)


def _require_enough(folder: Path, readable: int, total: int, problems: Sequence[str]) -> None:
    """Refuses a scene with fewer than three photographs, or of which half cannot be read."""
    if readable < max(FEWEST_PHOTOGRAPHS, total / 2):
        problem = "; ".join(problems) or f"only {readable} photographs are left"
        raise InputError(str(folder), problem, "Replace these files")


def _stored(
    examined: Mapping[Path, Photograph],
    masks: Mapping[Path, Path],
    panoramas: Set[Path],
    out_dir: Path,
) -> list[Photograph]:
    """Copies photographs and their masks, cuts panoramas and theirs; returns what there is then."""
    (out_dir / "images").mkdir(parents=True, exist_ok=True)
    (out_dir / MASKS).mkdir(exist_ok=True)
    kept: list[Photograph] = []
    for file, photograph in examined.items():
        if file in panoramas:
            mask = read_photograph(masks[file]) if file in masks else None
            kept += cut_photographs(photograph, read_photograph(file), out_dir, mask)
            continue
        kept.append(photograph)
        shutil.copyfile(file, out_dir / "images" / photograph.file)
        if file in masks:
            shutil.copyfile(masks[file], out_dir / MASKS / f"{photograph.name}.png")
    return kept


def given_views(capture_dir: Path) -> tuple[str, dict[str, GivenView]] | None:
    """Returns where the poses that came with a capture are from, and its views by name; or None."""
    path = capture_dir / GIVEN_POSES
    return read_given_poses(path) if path.exists() else None


def _examined(
    files: Sequence[Path], progress: Progress, *, keeps_sweeps: bool
) -> tuple[dict[Path, Photograph], list[str]]:
    """Returns the photographs that can be used, by their files, and what is wrong with the others.

    With `keeps_sweeps`, parts of panoramas are photographs like others.
    """
    stored = stored_files(files)
    names = photograph_names(stored)
    photographs, problems = {}, []
    for done, (file, file_name, name) in enumerate(zip(files, stored, names, strict=True)):
        progress(done, len(files))
        try:
            height, width, _ = read_photograph(file).shape
        except InputError as error:
            problems.append(f"{file.name} {error.problem}")
            continue
        if not keeps_sweeps and (fraction := fraction_of_directions(file)) < 1:
            problems.append(
                f"{file.name} is a panorama of {fraction:.0%} of all directions (with the setting"
                ' panoramas "no" it is a photograph)'
            )
            continue
        data = file.read_bytes()
        sha256 = hashlib.sha256(data).hexdigest()
        photographs[file] = Photograph(name, file_name, width, height, len(data), sha256)
    progress(len(files), len(files))
    return photographs, problems


def _warnings(folder: Path) -> list[str]:
    warnings = []
    if foreign := [path.name for path in files_below(folder, FOREIGN_SUFFIXES)]:
        warnings.append(f"passed over, to be converted first: {_listed(foreign)}")
    shots = {(file.parent, file.stem.casefold()) for file in photographs_below(folder)}
    clips = [
        path.name
        for path in files_below(folder, VIDEO_SUFFIXES)
        if (path.parent, path.stem.casefold()) not in shots
    ]
    if clips:  # but not those that telephones store with each photograph
        warnings.append(f"passed over, since there are photographs: {_listed(clips)}")
    return warnings


def _warnings_of_masks(folder: Path, found: FoundMasks) -> list[str]:
    names = [str(mask.relative_to(folder.parent)) for mask in found.unused]
    return [f"masks that fit no photograph (docs/captures.md): {_listed(names)}"] if names else []


def _warnings_of_poses(folder: Path, given: GivenPoses) -> list[str]:
    used = {view.file for view in given.views}
    beside = folder.iterdir() if folder.is_dir() else ()
    others = [p.name for p in beside if p.suffix.lower() in PHOTOGRAPH_SUFFIXES and p not in used]
    problems = {
        "names photographs that are missing": given.missing,
        "has no poses of": others,
    }
    return [
        f"{given.source.name} {problem}: {_listed(names)}"
        for problem, names in problems.items()
        if names
    ]


def _listed(names: Iterable[str]) -> str:
    ordered = sorted(names, key=natural_order)
    more = len(ordered) - _MOST_NAMES
    return ", ".join(ordered[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")
