"""A video as a capture: the frames that serve best as photographs (see `frame_choice`)."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from styletrf.colmap_images import write_png
from styletrf.errors import InputError
from styletrf.frame_choice import FrameMotion, chosen_frames, frame_motion
from styletrf.photographs import FEWEST_PHOTOGRAPHS
from styletrf.progress import Progress, silent
from styletrf.scene_capture import Capture, Photograph, write_capture
from styletrf.video import Frame, video_frames, video_info

_LEAST_SHARPNESS = 0.01  # of a median frame: photographs have 0.07 to 0.7, blurred by 1/480 less


def capture_video(video: Path, out_dir: Path, count: int, progress: Progress = silent) -> Capture:
    """Writes at most `count` frames of a video as `images/0001.png` and so on, and `capture.json`.

    Raises:
        InputError: The file is no video, its picture keeps still, or it has fewer than three
            frames to choose from.
    """
    motion = frame_motion(_told(video, progress))
    chosen = chosen_frames(motion, count)
    if len(chosen) < FEWEST_PHOTOGRAPHS:
        problem = f"gives {len(chosen)} frames, and {FEWEST_PHOTOGRAPHS} are needed"
        raise InputError(str(video), problem, "Film longer, or ask for more frames")
    (out_dir / "images").mkdir(parents=True, exist_ok=True)
    photographs = []
    wanted = dict(zip(chosen.tolist(), range(1, len(chosen) + 1), strict=True))
    for index, frame in enumerate(_told(video, progress)):
        if index in wanted:
            photographs.append(_photograph(frame, out_dir / "images" / f"{wanted[index]:04d}.png"))
    capture = Capture(tuple(photographs), tuple(_warnings(video, motion, len(chosen), count)))
    write_capture(out_dir, capture)
    return capture


def _told(video: Path, progress: Progress) -> Iterator[Frame]:
    total = video_info(video).frames
    for done, frame in enumerate(video_frames(video)):
        progress(min(done, total), total)
        yield frame
    progress(total, total)


def _photograph(frame: Frame, path: Path) -> Photograph:
    write_png(path, frame, compression=3)
    data, (height, width) = path.read_bytes(), frame.shape[:2]
    sha256 = hashlib.sha256(data).hexdigest()
    return Photograph(path.stem, path.name, width, height, len(data), sha256)


def _warnings(video: Path, motion: FrameMotion, chosen: int, count: int) -> Iterator[str]:
    if not motion.has_parallax:
        share = motion.parallax[-1] / motion.displacement[-1]
        yield (
            f"{video.name} hardly has parallax ({share:.1%} of its motion): a camera that turns on"
            " the spot sees no depth; film while walking past or around the scene"
        )
    if chosen < count:
        yield f"{video.name} gives {chosen} frames that differ, not {count}"
    worst = float(np.median(motion.sharpness))
    if worst < _LEAST_SHARPNESS:
        yield f"{video.name} is blurred throughout: hold the camera steadier, or use more light"
