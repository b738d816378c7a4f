"""The photographs as COLMAP is given them: upright PNGs, named by their position."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfile

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
from styletrf.sfm.lens_settings import Lenses, LensSetting, lens_settings

Image = UInt8[np.ndarray, "height width 3"]


@dataclass(frozen=True, slots=True)
class ColmapImages:
    """A folder of PNGs, the longest side of them all, and with which lens each was taken.

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
    """Writes the photographs of a capture into `folder`, upright and at most so large.

    Lens settings are those of `lens_settings`. Masks go into a folder beside, black and white alone
    and named, as COLMAP reads them.
    """
    folder.mkdir(parents=True)
    masks = folder.with_name(MASKS)
    masks.mkdir()
    total = len(capture.photographs)
    files = tuple(f"{index:06d}.png" for index in range(total))
    focals_px, long_side = [], 0
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
        long_side = max(long_side, *image.shape[:2])
        is_view = photograph.panorama is not None
        known_px = view_focal_px(image.shape[1]) if is_view else None
        focals_px.append(known_px or _focal_from_exif(path, max(image.shape)))
    progress(total, total)
    settings = lens_settings(files, capture.photographs, focals_px, lenses)
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


def _focal_from_exif(path: Path, long_side: int) -> float | None:
    """Returns the focal length that EXIF names, in pixels of an image so large.

    It is asked of the user's own files: the upright copies carry none.
    """
    with suppress(ValueError):  # COLMAP reads fewer formats than OpenCV, and need not here
        lens = pycolmap.infer_camera_from_image(path)
        if lens.has_prior_focal_length:
            return float(lens.mean_focal_length() * long_side / max(lens.width, lens.height))
    return heif_focal_px(path, long_side) if path.suffix.lower() in HEIF_SUFFIXES else None
