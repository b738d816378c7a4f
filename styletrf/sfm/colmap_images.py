"""The photographs as COLMAP is given them: upright PNGs, named by their position."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfile
from typing import Literal

import cv2
import numpy as np
from jaxtyping import UInt8

from styletrf.capture.capture_file import Capture, Photograph
from styletrf.capture.masks import MASKS, counted_pixels
from styletrf.capture.panorama.panorama_views import view_focal_px
from styletrf.capture.photographs import read_photograph
from styletrf.colmap import pycolmap
from styletrf.files.heif_images import HEIF_SUFFIXES, heif_focal_px
from styletrf.files.images import write_png
from styletrf.progress import Progress

Image = UInt8[np.ndarray, "height width 3"]
Lenses = Literal["auto", "one", "each"]
_ONE_SETTING = 1.03  # ratio of focal lengths, up to which they are one


@dataclass(frozen=True, slots=True)
class ColmapImages:
    """A folder of PNGs, the longest side of them all, and with which lens each was taken.

    Where some have masks, these are in a folder of their own. `panoramas` are the files that are
    views of one panorama, for each.
    """

    folder: Path
    files: tuple[str, ...]
    long_side: int
    lenses: tuple["LensSetting", ...]
    masks: Path | None = None
    panoramas: tuple[tuple[str, ...], ...] = ()

    @property
    def lenses_are_known(self) -> bool:
        """Whether all are views of panoramas, whose lenses are pinholes of known focal length."""
        return all(setting.direction is not None for setting in self.lenses)

    def mask_of(self, file: str) -> Path | None:
        """The mask of one of the files, or None; features are sought where it is white."""
        mask = self.masks / f"{file}.png" if self.masks else None
        return mask if mask and mask.exists() else None


@dataclass(frozen=True, slots=True)
class LensSetting:
    """Photographs of one size taken with one focal length, which is known or not.

    Views of panoramas differ in their `direction`, and have no distortion.
    """

    files: tuple[str, ...]
    focal_prior_px: float | None
    direction: str | None = None


def prepare_images(
    capture_dir: Path,
    capture: Capture,
    folder: Path,
    max_long_side: int,
    lenses: Lenses,
    progress: Progress,
) -> ColmapImages:
    """Writes the photographs of a capture into `folder`, upright and at most so large.

    Photographs of different sizes, before they are reduced, were taken with different lens
    settings. With `auto` lenses, so were photographs of one size whose EXIF names focal lengths
    more than 3 % above the shortest of their group; those that name none are of the commonest.
    Views of panoramas have a setting for each size and direction, of exact focal length. Masks go
    into a folder beside, black and white alone and named, as COLMAP reads them.
    """
    folder.mkdir(parents=True)
    masks = folder.with_name(MASKS)
    masks.mkdir()
    total = len(capture.photographs)
    files = tuple(f"{index:06d}.png" for index in range(total))
    sizes, focals_px, long_side = [], [], 0
    for index, (photograph, file) in enumerate(zip(capture.photographs, files, strict=True)):
        progress(index, total)
        path = capture_dir / "images" / photograph.file
        image = _at_most(read_photograph(path), max_long_side)
        is_written = photograph.clip is not None or photograph.panorama is not None
        if is_written and image.shape[1] == photograph.width:
            copyfile(path, folder / file)  # a frame or a view is an upright PNG already
        else:
            write_png(folder / file, image, compression=1)
        mask = capture_dir / MASKS / f"{photograph.name}.png"
        if mask.exists():
            counts = counted_pixels(_at_most(read_photograph(mask), max_long_side))
            black_and_white = np.dstack([np.uint8(255) * counts] * 3)
            write_png(masks / f"{file}.png", black_and_white, compression=1)
        sizes.append((photograph.width, photograph.height))
        long_side = max(long_side, *image.shape[:2])
        is_view = photograph.panorama is not None
        known_px = view_focal_px(image.shape[1]) if is_view else None
        focals_px.append(known_px or _focal_from_exif(path, max(image.shape)))
    progress(total, total)
    directions = [photograph.direction for photograph in capture.photographs]
    settings = lens_settings(files, sizes, focals_px, lenses, directions)
    some_masks = masks if any(masks.iterdir()) else None
    panoramas = _views_of_panoramas(files, capture.photographs)
    return ColmapImages(folder, files, long_side, settings, some_masks, panoramas)


def _views_of_panoramas(
    files: Sequence[str], photographs: Sequence[Photograph]
) -> tuple[tuple[str, ...], ...]:
    found: dict[str, list[str]] = {}
    for file, photograph in zip(files, photographs, strict=True):
        if photograph.panorama is not None:
            found.setdefault(photograph.panorama, []).append(file)
    return tuple(map(tuple, found.values()))


def _at_most(
    image: Image, max_long_side: int
) -> UInt8[np.ndarray, "reduced_height reduced_width 3"]:
    """Returns the image, reduced by area where its longer side is above the bound."""
    height, width = image.shape[:2]
    scale = max_long_side / max(width, height)
    if scale >= 1:
        return image
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def lens_settings(
    files: Sequence[str],
    sizes: Sequence[tuple[int, int]],
    focals_px: Sequence[float | None],
    lenses: Lenses,
    directions: Sequence[str | None],
) -> tuple[LensSetting, ...]:
    """Returns which photographs share a lens setting, and each setting's median focal length."""
    kinds = [(direction or "", size) for direction, size in zip(directions, sizes, strict=True)]
    groups = []
    for kind in sorted(set(kinds)):
        alike = [k for k, other in enumerate(kinds) if other == kind]
        is_view = directions[alike[0]] is not None
        groups += [alike] if is_view else _of_one_size(alike, focals_px, lenses)
    return tuple(
        LensSetting(
            tuple(files[k] for k in sorted(group)),
            _median([f for k in group if (f := focals_px[k]) is not None]),
            directions[group[0]],
        )
        for group in sorted(groups, key=min)
    )


def _of_one_size(
    photographs: Sequence[int], focals_px: Sequence[float | None], lenses: Lenses
) -> list[list[int]]:
    """Returns the photographs, all of one size, in groups of one focal length."""
    if lenses == "each":
        return [[k] for k in photographs]
    known = sorted((f, k) for k in photographs if (f := focals_px[k]) is not None)
    groups = [[k for _, k in run] for run in _runs(known)] if lenses == "auto" else []
    groups = groups if len(groups) > 1 else [[k for _, k in known]]
    max(groups, key=len).extend(k for k in photographs if focals_px[k] is None)
    return groups


def _runs(known: Sequence[tuple[float, int]]) -> list[list[tuple[float, int]]]:
    """Returns ascending focal lengths cut where one is more than 3 % above its run's first."""
    runs: list[list[tuple[float, int]]] = []
    for focal, k in known:
        if not runs or focal > _ONE_SETTING * runs[-1][0][0]:
            runs.append([])
        runs[-1].append((focal, k))
    return runs


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def _focal_from_exif(path: Path, long_side: int) -> float | None:
    """Returns the focal length that EXIF names, in pixels of an image so large.

    It is asked of the user's own files: the upright copies carry none.
    """
    with suppress(ValueError):  # COLMAP reads fewer formats than OpenCV, and need not here
        lens = pycolmap.infer_camera_from_image(path)
        if lens.has_prior_focal_length:
            return float(lens.mean_focal_length() * long_side / max(lens.width, lens.height))
    return heif_focal_px(path, long_side) if path.suffix.lower() in HEIF_SUFFIXES else None
