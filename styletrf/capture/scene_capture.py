"""A scene's photographs, checked and kept as they are: exact copies and `capture.json`.

A photograph that is damaged is left out with a warning while enough of them are whole.
"""

import shutil
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

from styletrf.capture.capture_file import Capture, Photograph, write_capture
from styletrf.capture.capture_warnings import capture_warnings
from styletrf.capture.left_out import without
from styletrf.capture.mask_files import find_masks
from styletrf.capture.masks import MASKS, read_mask_image, require_mask_of
from styletrf.capture.panorama.panorama_capture import cut_photographs
from styletrf.capture.panorama.panoramas import Choice, find_panoramas, fraction_of_directions
from styletrf.capture.photograph_names import (
    photograph_names,
    require_own_names,
    stored_files,
)
from styletrf.capture.photographs import (
    FEWEST_PHOTOGRAPHS,
    MORE_PHOTOGRAPHS,
    list_photographs,
    photographs_below,
    read_photograph,
)
from styletrf.capture.poses.given_poses import (
    GivenPoses,
    GivenView,
    read_given_poses,
    write_given_poses,
)
from styletrf.configuration import require_at_least
from styletrf.errors import InputError
from styletrf.files.digests import sha256_of
from styletrf.progress import Progress, silent

GIVEN_POSES = "given_poses.json"
"""In a capture, the poses that came with the photographs."""


@dataclass(frozen=True, slots=True)
class CaptureConfig:
    """The choice of the photographs that are taken.

    Args:
        video_frames: The most frames that are taken of all videos of a scene together.
        leave_out: Names, paths or patterns such as `IMG_00*` of photographs that are not taken, and
            of frames of videos; see `styletrf.capture.left_out`.
        panoramas: Whether photographs and videos are equirectangular, of all directions, and cut
            into views; `auto` decides by their metadata and pixels.
    """

    video_frames: int = 60
    leave_out: tuple[str, ...] = ()
    panoramas: Choice = "auto"

    def __post_init__(self) -> None:
        require_at_least(FEWEST_PHOTOGRAPHS, self, "video_frames")


def capture_photographs(
    folder: Path,
    out_dir: Path,
    progress: Progress = silent,
    given: GivenPoses | None = None,
    leave_out: Sequence[str] = (),
    panoramas: Choice = "auto",
    skipped: Sequence[Path] = (),
) -> Capture:
    """Checks all photographs of `folder`; copies their bytes and writes `capture.json`.

    `out_dir` receives `images/<file>`, `masks/<name>.png` of those that have one (see
    `styletrf.capture.mask_files`), and, last, `capture.json` (see `read_capture`). A photograph's
    `name` is that of `styletrf.capture.photograph_names`. Oddities are logged as warnings, too.
    With poses that are `given`, their photographs alone are taken, and `given_poses.json` is
    written; their lenses are given, too, so that none is looked at as a panorama. Other panoramas
    are replaced by views cut from them. A warning names the videos in `folder`, and the `skipped`
    ones elsewhere, that have no photograph of the same name.

    Raises:
        InputError: There are too few photographs, fewer than half of them can be used (one error
            names all that cannot), a mask is invalid, a photograph has the name of a view of a
            panorama, or `leave_out` names none. Nothing is written then.
    """
    _require_one_lens_source(folder, given, panoramas)
    taken = [view.file for view in given.views] if given else list_photographs(folder)
    files = without(folder, taken, leave_out)
    examined, problems = _examined(
        files, progress, keeps_sweeps=given is not None or panoramas != "auto"
    )
    _require_enough(folder, len(examined), len(files), problems)
    found = find_masks(folder, list(dict.fromkeys([*taken, *photographs_below(folder)])))
    masks = found.by_picture
    again = [] if given else _repeated(examined, masks.keys())
    examined = {file: one for file, one in examined.items() if file not in again}
    if len(examined) < FEWEST_PHOTOGRAPHS:
        problem = f"only {len(examined)} of the photographs differ"
        raise InputError(str(folder), problem, MORE_PHOTOGRAPHS)
    for file in masks.keys() & examined.keys():
        require_mask_of(masks[file], examined[file].width, examined[file].height)
    sizes = {file: (one.width, one.height) for file, one in examined.items()}
    cut = find_panoramas(sizes, "no" if given else panoramas)
    require_own_names(examined, cut)
    kept = _stored(examined, masks, cut, out_dir)
    counts = len(cut), len(sizes)
    warnings = capture_warnings(folder, problems, again, found, counts, given, skipped)
    if given:
        views = {view.file: view for view in given.views}
        named = {photograph.name: views[file] for file, photograph in examined.items()}
        write_given_poses(out_dir / GIVEN_POSES, given.name, named)
    capture = Capture(tuple(kept), tuple(warnings))
    write_capture(out_dir, capture)
    return capture


def _repeated(photographs: Mapping[Path, Photograph], masked: Set[Path]) -> list[Path]:
    """Returns the files that repeat another one, which is that with a mask, or else the first.

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
        remedy = f"Take {given.name} away, or leave the setting panoramas at auto"
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
    """Copies photographs and masks, cuts panoramas and theirs; returns the stored photographs."""
    (out_dir / "images").mkdir(parents=True, exist_ok=True)
    (out_dir / MASKS).mkdir(exist_ok=True)
    kept: list[Photograph] = []
    for file, photograph in examined.items():
        if file in panoramas:
            mask = read_mask_image(masks[file]) if file in masks else None
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
        content = file.read_bytes()
        size, digest = len(content), sha256_of(content)
        photographs[file] = Photograph(name, file_name, width, height, size, digest)
    progress(len(files), len(files))
    return photographs, problems
