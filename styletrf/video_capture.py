"""Videos of one scene as a capture: the frames that serve best as photographs.

See `frame_choice`. Several clips share the frames by the length of the way that each goes.
"""

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from styletrf.clip_survey import clip_warnings
from styletrf.colmap_images import write_png
from styletrf.errors import InputError
from styletrf.frame_choice import chosen_frames
from styletrf.frame_motion import FrameMotion, frame_motion, joined_motion
from styletrf.photographs import FEWEST_PHOTOGRAPHS
from styletrf.progress import Progress, silent
from styletrf.scene_capture import Capture, Photograph, write_capture
from styletrf.video import Frame, TimedFrame, declared_duration_s, timed_frames, video_info


def capture_videos(
    videos: Sequence[Path], out_dir: Path, count: int, progress: Progress = silent
) -> Capture:
    """Writes at most `count` frames of a scene's videos as `images/*.png`, and `capture.json`.

    Frames of a single video are named `0001` and so on, those of several `NAME_0001`. Each knows
    its clip, its time there and how many cuts lie before it.

    Raises:
        InputError: A file is no video, the pictures keep still, or there are fewer than three
            frames to choose from.
    """
    motions = [frame_motion(_followed(video, progress)) for video in videos]
    _require_frames(videos, motions)
    chosen = _chosen_of_each(motions, count)
    total = sum(len(frames) for frames in chosen)
    if total < FEWEST_PHOTOGRAPHS:
        subject = ", ".join(str(video) for video in videos)
        problem = f"gives {total} frames, and {FEWEST_PHOTOGRAPHS} are needed"
        raise InputError(subject, problem, "Film longer, or ask for more frames")
    (out_dir / "images").mkdir(parents=True, exist_ok=True)
    photographs = [
        photograph
        for video, motion, frames, prefix in zip(
            videos, motions, chosen, _prefixes(videos), strict=True
        )
        for photograph in _photographs(video, motion, frames, out_dir / "images", prefix, progress)
    ]
    capture = Capture(tuple(photographs), tuple(_warnings(videos, motions, total, count)))
    write_capture(out_dir, capture)
    return capture


def _require_frames(videos: Sequence[Path], motions: Sequence[FrameMotion]) -> None:
    for video, motion in zip(videos, motions, strict=True):
        if len(motion.time_s) == 0:
            raise InputError(str(video), "holds no frame that can be decoded", "Copy it again")


def _followed(video: Path, progress: Progress) -> Iterator[TimedFrame]:
    total = video_info(video).frames
    for done, frame in enumerate(timed_frames(video)):
        progress(min(done, total), total)
        yield frame
    progress(total, total)


def _chosen_of_each(motions: Sequence[FrameMotion], count: int) -> list[list[int]]:
    """Returns the indices of the frames to take of each clip, which may be none."""
    chosen = chosen_frames(joined_motion(motions), count)
    ends = np.cumsum([len(motion.time_s) for motion in motions])
    clip = np.searchsorted(ends, chosen, side="right")
    starts = ends - [len(motion.time_s) for motion in motions]
    return [(chosen[clip == k] - starts[k]).tolist() for k in range(len(motions))]


def _photographs(
    video: Path,
    motion: FrameMotion,
    frames: Sequence[int],
    folder: Path,
    prefix: str,
    progress: Progress,
) -> Iterator[Photograph]:
    """Writes the frames of a clip and yields what `capture.json` says of them."""
    wanted = dict(zip(frames, range(1, len(frames) + 1), strict=True))
    for index, frame in enumerate(_followed(video, progress)):
        if index in wanted:
            path = folder / f"{prefix}{wanted[index]:04d}.png"
            size_bytes, sha256 = _written(frame.pixels, path)
            height, width = frame.pixels.shape[:2]
            shot = int(motion.shot[index])
            yield Photograph(
                path.stem,
                path.name,
                width,
                height,
                size_bytes,
                sha256,
                clip=video.name,
                shot=shot,
                time_s=frame.time_s,
            )


def _written(frame: Frame, path: Path) -> tuple[int, str]:
    write_png(path, frame, compression=3)
    data = path.read_bytes()
    return len(data), hashlib.sha256(data).hexdigest()


def _prefixes(videos: Sequence[Path]) -> list[str]:
    """Returns what goes before the numbers of each clip's frames: nothing where there is one."""
    if len(videos) == 1:
        return [""]
    times = Counter(video.stem.casefold() for video in videos)
    unique = max(times.values()) == 1
    return [f"{video.stem if unique else video.name.replace('.', '_')}_" for video in videos]


def _warnings(
    videos: Sequence[Path], motions: Sequence[FrameMotion], chosen: int, count: int
) -> Iterator[str]:
    for video, motion in zip(videos, motions, strict=True):
        yield from clip_warnings(video.name, motion, declared_duration_s(video))
    if chosen < count:
        names = ", ".join(video.name for video in videos)
        gives = "gives" if len(videos) == 1 else "give"
        yield f"{names} {gives} {chosen} frames that differ, not {count}"
