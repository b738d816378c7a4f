"""The photographs as COLMAP reads them: upright PNGs, named by their position."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfile

import cv2
import numpy as np
from jaxtyping import UInt8

from styletrf.capture.capture_file import Capture, Photograph
from styletrf.capture.masks import MASKS, counted_pixels, read_mask_image
from styletrf.capture.panorama.panorama_views import view_focal_px
from styletrf.capture.photographs import read_photograph
from styletrf.colmap import pycolmap
from styletrf.files.heif_images import HEIF_SUFFIXES, heif_focal_px
from styletrf.files.images import write_png
from styletrf.prefetch import prefetch
from styletrf.progress import Progress
from styletrf.sfm.lens_settings import Lenses, LensSetting, lens_settings

Image = UInt8[np.ndarray, "height width 3"]
_THREADS = 4  # of which each holds a whole photograph


@dataclass(frozen=True, slots=True)
class ColmapImages:
    """A folder of PNGs, the longest side of them all, and the lens that took each.

    Where some have masks, these are in a folder of their own. `panoramas` are the files that are
    views of one panorama, for each.
    """

    folder: Path
    files: tuple[str, ...]
    long_side: int
    lenses: tuple[LensSetting, ...]
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


def prepare_images(
    capture_dir: Path,
    capture: Capture,
    folder: Path,
    max_long_side: int,
    lenses: Lenses,
    progress: Progress,
) -> ColmapImages:
    """Writes the photographs of a capture into `folder`, upright and at most this large.

    Lens settings are those of `lens_settings`. Masks go into a folder beside, black and white alone
    and named, as COLMAP reads them.
    """
    folder.mkdir(parents=True)
    masks = folder.with_name(MASKS)
    masks.mkdir()
    total = len(capture.photographs)
    files = tuple(f"{index:06d}.png" for index in range(total))

    def prepare(index: int) -> "_Prepared":
        """Writes a photograph, and its mask if it has one."""
        photograph = capture.photographs[index]
        mask, file = capture_dir / MASKS / f"{photograph.name}.png", files[index]
        if mask.exists():
            _write_mask(mask, masks / f"{file}.png", max_long_side)
        path = capture_dir / "images" / photograph.file
        return _prepared(photograph, path, folder / file, max_long_side)

    done: list[_Prepared] = []
    threads = min(_THREADS, os.cpu_count() or 1)
    for one in prefetch(prepare, range(total), threads=threads, ahead=2 * threads):
        progress(len(done), total)
        done.append(one)
    progress(total, total)
    focals_px, long_side = [one.focal_px for one in done], max(one.long_side for one in done)
    settings = lens_settings(files, capture.photographs, focals_px, lenses)
    some_masks = masks if any(masks.iterdir()) else None
    panoramas = _views_of_panoramas(files, capture.photographs)
    return ColmapImages(folder, files, long_side, settings, some_masks, panoramas)


@dataclass(frozen=True, slots=True)
class _Prepared:
    """The longer side of an image that was written, and its focal length if that is known."""

    long_side: int
    focal_px: float | None


def _prepared(photograph: Photograph, source: Path, target: Path, max_long_side: int) -> _Prepared:
    """Writes a photograph as a PNG of at most this size; returns its side and focal length."""
    image = _at_most(read_photograph(source), max_long_side)
    height, width = image.shape[:2]
    is_written = photograph.clip is not None or photograph.panorama is not None
    if is_written and width == photograph.width:
        copyfile(source, target)  # a frame or a view is an upright PNG already
    else:
        write_png(target, image, compression=1)
    if photograph.panorama is not None:
        return _Prepared(max(height, width), view_focal_px(width))
    focal_px = None if is_written else _focal_from_exif(source, max(height, width))
    return _Prepared(max(height, width), focal_px)


def _write_mask(source: Path, target: Path, max_long_side: int) -> None:
    """Writes a mask as COLMAP reads it: black and white alone."""
    counts = counted_pixels(_at_most(read_mask_image(source), max_long_side))
    write_png(target, np.dstack([np.uint8(255) * counts] * 3), compression=1)


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


def _focal_from_exif(path: Path, long_side: int) -> float | None:
    """Returns the focal length that EXIF names, in pixels of an image of this size.

    EXIF is read from the user's own files: the upright copies have none.
    """
    with suppress(ValueError):  # COLMAP reads fewer formats than OpenCV, and need not here
        lens = pycolmap.infer_camera_from_image(path)
        if lens.has_prior_focal_length:
            return float(lens.mean_focal_length() * long_side / max(lens.width, lens.height))
    return heif_focal_px(path, long_side) if path.suffix.lower() in HEIF_SUFFIXES else None
