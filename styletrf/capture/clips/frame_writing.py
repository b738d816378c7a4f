"""Writes the chosen frames of clips as photographs, and their masks beside them."""

from collections.abc import Iterator, Mapping
from contextlib import closing
from itertools import repeat
from pathlib import Path

from styletrf.capture.capture_file import Photograph
from styletrf.capture.clips.clip_masks import masks_of_frames, require_size_of_clip
from styletrf.capture.clips.frame_motion import FrameMotion
from styletrf.capture.masks import MASKS
from styletrf.capture.panorama.panorama_capture import cut_photographs
from styletrf.capture.photograph_file import write_photograph
from styletrf.files.images import write_png
from styletrf.files.video_frames import Frame, timed_frames
from styletrf.prefetch import in_background, prefetch

_WRITERS, _AHEAD = 2, 3  # threads that write frames while the next are decoded

DecodedFrame = tuple[Frame, Frame | None, Photograph]
"""A frame, the mask of it if its clip has one, and its photograph, which has no file yet."""


def decoded_frames(
    video: Path, clip: str, motion: FrameMotion, names: Mapping[int, str], mask: Path | None
) -> Iterator[DecodedFrame]:
    """Yields some frames of a clip in their order.

    Args:
        video: The file of the clip.
        clip: The name of the clip.
        motion: The measures of all of its frames.
        names: The names of the frames by their indices.
        mask: The mask of the clip, see `clip_masks`.

    Raises:
        InputError: The mask does not fit the clip.
    """
    masks = masks_of_frames(mask, names.keys(), len(motion.time_s)) if mask else repeat(None)
    for index, frame in zip(sorted(names), timed_frames(video, names.keys()), strict=False):
        height, width = frame.pixels.shape[:2]
        of_clip = clip, int(motion.shot[index]), frame.time_s
        name, counted = names[index], next(masks)
        if counted is not None:
            require_size_of_clip(mask or video, counted, frame.pixels)
        photograph = Photograph(name, f"{name}.png", width, height, 0, "", *of_clip)
        yield frame.pixels, counted, photograph
    next(masks, None)  # at its end a mask is refused that has another number of frames


def written_frames(
    frames: Iterator[DecodedFrame], out_dir: Path, *, is_panorama: bool
) -> Iterator[Photograph]:
    """Writes frames, or the views cut from them, and yields their photographs.

    What a mask covers completely is not written.

    Args:
        frames: Of one clip.
        out_dir: Receives `images/<name>.png`, and `masks/<name>.png` of those that have masks.
        is_panorama: Whether views are cut from the frames, and from their masks.
    """
    (out_dir / "images").mkdir(parents=True, exist_ok=True)

    def write(decoded: DecodedFrame) -> list[Photograph]:
        """Writes one frame; returns its photographs."""
        frame, mask, photograph = decoded
        if mask is not None:
            (out_dir / MASKS).mkdir(exist_ok=True)
        if is_panorama:
            return list(cut_photographs(photograph, frame, out_dir, mask))
        if mask is not None:
            if not mask.any():
                return []
            write_png(out_dir / MASKS / f"{photograph.name}.png", mask, compression=1)
        return [write_photograph(out_dir, photograph, frame)]

    with closing(in_background(frames, ahead=_AHEAD)) as decoded:
        for kept in prefetch(write, decoded, threads=_WRITERS, ahead=_AHEAD):
            yield from kept
