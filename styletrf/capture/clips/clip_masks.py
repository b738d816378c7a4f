"""Masks of clips: which pixels of their frames count.

The mask of a clip is a video, or a folder with one PNG file for each frame. Its frames are those of
the clip by their order, and not by their times: programs that find people write a frame for each
one that they decode, at a rate of their own. So a mask has as many frames as its clip.
"""

import re
from collections.abc import Iterator, Mapping, Set
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from styletrf.capture.masks import counted_pixels, read_mask_image
from styletrf.capture.photographs import natural_order
from styletrf.errors import InputError
from styletrf.files.video_frames import (
    Frame,
    decodable_frames,
    first_frame,
    has_alpha,
    timed_frames,
    video_info,
)

AnyFrame = UInt8[np.ndarray, "_ _ 3"]
"""A frame whose size has yet to be compared with another one."""


def require_masks_of_clips(masks: Mapping[Path, Path]) -> None:
    """Refuses masks that do not fit their clips: of another size, number of frames, or with alpha.

    Only the first frames are decoded, unless the files seem to differ in their number.

    Args:
        masks: The masks by their clips.

    Raises:
        InputError: A mask does not fit, or it or its clip cannot be read.
    """
    for clip, mask in masks.items():
        _require_black_and_white(mask)
        require_size_of_clip(mask, _first_of(mask), first_frame(clip).pixels)
        packets = video_info(clip).frames, _packets_of(mask)
        if packets[0] != packets[1]:  # a packet that is damaged or trimmed holds no frame to see
            _require_as_many(mask, decodable_frames(clip))


def _require_black_and_white(mask: Path) -> None:
    """Refuses a video with alpha, which may be the mask itself, and files that are not numbered.

    Raises:
        InputError: It is one of these.
    """
    if not mask.is_dir():
        if has_alpha(mask):
            remedy = "Export the mask as an opaque video in black and white"
            raise InputError(str(mask), "has an alpha channel, which is not read", remedy)
        return
    for file, following in pairwise(_files_of(mask)):
        if not _follows(file.stem, following.stem):
            problem = f"has no number for each frame: after {file.name} comes {following.name}"
            raise InputError(str(mask), problem, "Number the frames one after the other")


def _follows(name: str, following: str) -> bool:
    """Returns whether some number in a name is one more than in the name before."""
    numbers = [[int(number) for number in re.findall(r"\d+", n)] for n in (name, following)]
    return any(second == first + 1 for first, second in zip(*numbers, strict=False))


def require_size_of_clip(mask: Path, pixels: AnyFrame, frame: AnyFrame) -> None:
    """Refuses a mask whose frame is not as large as that of the clip.

    Raises:
        InputError: It is of another size.
    """
    if pixels.shape != frame.shape:
        (height, width), (rows, columns) = pixels.shape[:2], frame.shape[:2]
        problem = f"is {width}x{height}, and its clip upright {columns}x{rows}"
        raise InputError(str(mask), problem, "Export it at the size of the upright clip")


def masks_of_frames(mask: Path, indices: Set[int], total: int) -> Iterator[Frame]:
    """Yields the masks of some frames of a clip: white where the frame counts, black elsewhere.

    Args:
        mask: A video or a folder.
        indices: The places of the frames in the clip; they are taken in ascending order.
        total: The number of frames of the clip.

    Raises:
        InputError: The mask has another number of frames; whether it has more, or fewer behind the
            last of the indices, is known once the iterator ends.
    """
    wanted = {*indices, total - 1, total}  # the last two show whether there are as many
    found = -1
    for found, pixels in zip(sorted(wanted), _frames(mask, wanted), strict=False):
        if found in indices:
            yield np.dstack([np.uint8(255) * counted_pixels(pixels)] * 3)
    if found != total - 1:
        _require_as_many(mask, total)


def _frames(mask: Path, indices: Set[int]) -> Iterator[Frame]:
    """Yields the frames of a mask at these places, of those that it has."""
    if not mask.is_dir():
        for frame in timed_frames(mask, indices):
            yield frame.pixels
        return
    files = _files_of(mask)
    for index in sorted(indices):
        if index < len(files):
            yield read_mask_image(files[index])


def _first_of(mask: Path) -> Frame:
    return read_mask_image(_files_of(mask)[0]) if mask.is_dir() else first_frame(mask).pixels


def _packets_of(mask: Path) -> int:
    return len(_files_of(mask)) if mask.is_dir() else video_info(mask).frames


def _files_of(folder: Path) -> list[Path]:
    """Returns the PNG files of a folder in natural order (`2.png` before `10.png`)."""
    files = (path for path in folder.iterdir() if path.suffix.lower() == ".png")
    seen = (path for path in files if path.name[0] != "." and path.is_file())
    return sorted(seen, key=lambda path: natural_order(path.name))


def _require_as_many(mask: Path, total: int) -> None:
    """Refuses a mask that has not as many frames as its clip.

    Raises:
        InputError: It has more or fewer.
    """
    count = len(_files_of(mask)) if mask.is_dir() else decodable_frames(mask)
    if count != total:
        problem = f"has {count} frames, and its clip {total}"
        remedy = (
            "Export one frame of the mask for each frame of the clip, in their order;"
            " encode a damaged clip again first"
        )
        raise InputError(str(mask), problem, remedy)
