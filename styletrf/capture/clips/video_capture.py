"""Videos of one scene as a capture: the frames that serve best as photographs.

`frame_choice` chooses them. Several clips share the frames by the length of the way that each goes.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import closing
from itertools import islice
from pathlib import Path

import numpy as np

from styletrf.capture.capture_file import Capture, Photograph, write_capture
from styletrf.capture.clips.clip_survey import clip_warnings
from styletrf.capture.clips.frame_choice import chosen_frames
from styletrf.capture.clips.frame_motion import (
    FrameMotion,
    examined_size,
    frame_motion,
    joined_motion,
)
from styletrf.capture.left_out import left_out, names_of_frame
from styletrf.capture.panorama.panorama_capture import cut_photographs
from styletrf.capture.panorama.panorama_views import DIRECTIONS
from styletrf.capture.panorama.panoramas import (
    Choice,
    has_panorama_shape,
    panorama_mismatch,
    require_all_directions,
    show_panoramas,
)
from styletrf.capture.photograph_file import write_photograph
from styletrf.capture.photograph_names import distinct, shortened
from styletrf.capture.photographs import FEWEST_PHOTOGRAPHS
from styletrf.errors import InputError
from styletrf.files.video_frames import (
    Frame,
    TimedFrame,
    declared_duration_s,
    first_frame,
    timed_frames,
    video_info,
)
from styletrf.prefetch import in_background, prefetch
from styletrf.progress import Progress, silent

_LOOKED_AT, _EVERY = 10, 30  # frames that decide whether a clip is of panoramas
_WRITERS, _AHEAD = 2, 3  # threads that write frames while the next are decoded


def capture_videos(
    videos: Sequence[Path],
    out_dir: Path,
    count: int,
    progress: Progress = silent,
    panoramas: Choice = "auto",
    leave_out: Sequence[str] = (),
    skipped: Sequence[str] = (),
) -> Capture:
    """Writes at most `count` frames of a scene's videos as `images/*.png`, and `capture.json`.

    Frames of a single video are named `0001` and so on, those of several `NAME_0001`. Each has its
    clip, its time there and the number of cuts before it. Frames that are panoramas are replaced by
    views cut from them, and each view counts. Of the frames that were chosen those named by
    `leave_out` are not written (see `styletrf.capture.left_out`); the others keep their names. A
    warning names the photographs beside the videos that are `skipped`.

    Raises:
        InputError: A file is no video, its pictures change their shape or keep still, there are
            fewer than three frames to choose from or left, or nothing to leave out by such a name.
    """
    cut = {video for video in videos if _is_panorama(video, panoramas)}
    motions = [frame_motion(_followed(video, progress)) for video in videos]
    views = [len(DIRECTIONS) if video in cut else 1 for video in videos]
    most, chosen = _most_frames(motions, views, count)
    total = sum(len(frames) for frames in chosen)
    _require_enough(videos, total, "Film longer, or ask for more frames")
    taken = _not_left_out(_named(videos, chosen), leave_out)
    _require_enough(videos, sum(map(len, taken)), "Leave out fewer")
    (out_dir / "images").mkdir(parents=True, exist_ok=True)
    photographs = [
        kept
        for video, clip, motion, names in zip(
            videos, _clip_names(videos), motions, taken, strict=True
        )
        for kept in _written(
            _photographs(video, clip, motion, names), out_dir, is_panorama=video in cut
        )
    ]
    warnings = [
        *_input_warnings(videos, cut, skipped),
        *_warnings(videos, motions, chosen, most),
    ]
    capture = Capture(tuple(photographs), tuple(warnings))
    write_capture(out_dir, capture)
    return capture


def _require_enough(videos: Sequence[Path], total: int, remedy: str) -> None:
    if total < FEWEST_PHOTOGRAPHS:
        subject = ", ".join(str(video) for video in videos)
        problem = f"gives {total} frames, and {FEWEST_PHOTOGRAPHS} are needed"
        raise InputError(subject, problem, remedy)


def _followed(video: Path, progress: Progress) -> Iterator[TimedFrame]:
    """Yields the frames of a clip.

    Raises:
        InputError: They change their shape, so that no motion is seen from one to the next.
    """
    total = video_info(video).frames
    shapes = set[tuple[int, int]]()
    for done, frame in enumerate(timed_frames(video)):
        progress(min(done, total), total)
        height, width = frame.pixels.shape[:2]
        shapes.add(examined_size(height, width))
        if len(shapes) > 1:
            problem = f"changes its picture to {width}x{height} pixels after {frame.time_s:.1f} s"
            raise InputError(str(video), problem, "Split it there into two clips")
        yield frame
    progress(total, total)


def _most_frames(
    motions: Sequence[FrameMotion], views: Sequence[int], count: int
) -> tuple[int, list[list[int]]]:
    """Returns the most frames of all clips that give at most `count` views, and their indices.

    Args:
        motions: The motion in each clip.
        views: How many views each frame of a clip gives.
        count: The most views.
    """
    joined, lengths = joined_motion(motions), [len(motion.time_s) for motion in motions]
    fewest = count // max(views)
    for frames in range(count // min(views), fewest, -1):
        chosen = _chosen_of_each(joined, lengths, frames)
        if sum(n * len(of_clip) for n, of_clip in zip(views, chosen, strict=True)) <= count:
            return frames, chosen
    return fewest, _chosen_of_each(joined, lengths, fewest)


def _chosen_of_each(joined: FrameMotion, lengths: Sequence[int], count: int) -> list[list[int]]:
    """Returns the indices of the frames to take of each clip, which may be none.

    Args:
        joined: The motion in all clips, one after another.
        lengths: The number of frames of each clip.
        count: How many frames to take of all clips together.
    """
    chosen, ends = chosen_frames(joined, count), np.cumsum(lengths)
    clip, starts = np.searchsorted(ends, chosen, side="right"), ends - lengths
    return [(chosen[clip == k] - starts[k]).tolist() for k in range(len(lengths))]


def _is_panorama(video: Path, choice: Choice) -> bool:
    """Returns whether a clip is of panoramas, by its metadata or its frames.

    Raises:
        InputError: It should be one, and its frames do not show all directions; or no frame can be
            decoded.
    """
    first = first_frame(video)
    height, width = first.pixels.shape[:2]
    if choice == "yes" or (choice == "auto" and first.is_equirectangular):
        require_all_directions(video.name, width, height)
        return True
    if choice == "no" or not has_panorama_shape(width, height):
        return False
    frames = islice(timed_frames(video), 0, _LOOKED_AT * _EVERY, _EVERY)
    return show_panoramas([panorama_mismatch(frame.pixels) for frame in frames])


def _named(videos: Sequence[Path], chosen: Sequence[Sequence[int]]) -> list[dict[int, str]]:
    """Returns the names of the frames of each clip, by their indices."""
    return [
        {index: f"{prefix}{number:04d}" for number, index in enumerate(frames, start=1)}
        for prefix, frames in zip(frame_prefixes(videos), chosen, strict=True)
    ]


def _not_left_out(
    named: Sequence[Mapping[int, str]], leave_out: Sequence[str]
) -> list[dict[int, str]]:
    """Returns the frames of each clip that nothing leaves out.

    Raises:
        InputError: There is nothing to leave out by such a name.
    """
    known = [names_of_frame(name) for names in named for name in names.values()]
    gone = {known[index].name for index in left_out(leave_out, known)}
    return [{i: name for i, name in names.items() if name not in gone} for names in named]


def _clip_names(videos: Sequence[Path]) -> list[str]:
    """Returns the names of the files, with numbers where files in several folders share one."""
    return distinct([video.name for video in videos])


def _photographs(
    video: Path, clip: str, motion: FrameMotion, names: Mapping[int, str]
) -> Iterator[tuple[Frame, Photograph]]:
    """Yields the frames of a clip, each with its photograph, which has no file yet."""
    for index, frame in zip(sorted(names), timed_frames(video, names.keys()), strict=False):
        height, width = frame.pixels.shape[:2]
        of_clip = clip, int(motion.shot[index]), frame.time_s
        name = names[index]
        yield frame.pixels, Photograph(name, f"{name}.png", width, height, 0, "", *of_clip)


def _written(
    frames: Iterator[tuple[Frame, Photograph]], out_dir: Path, *, is_panorama: bool
) -> Iterator[Photograph]:
    """Writes frames, or the views cut from them, and yields their photographs."""

    def write(decoded: tuple[Frame, Photograph]) -> list[Photograph]:
        frame, photograph = decoded
        if is_panorama:
            return list(cut_photographs(photograph, frame, out_dir))
        return [write_photograph(out_dir, photograph, frame)]

    with closing(in_background(frames, ahead=_AHEAD)) as decoded:
        for kept in prefetch(write, decoded, threads=_WRITERS, ahead=_AHEAD):
            yield from kept


def frame_prefixes(videos: Sequence[Path]) -> list[str]:
    """Returns the prefix of the numbers of each clip's frames, which is empty for a single clip."""
    if len(videos) == 1:
        return [""]
    stems = [shortened(video.stem) for video in videos]
    names = [shortened(video.name.replace(".", "_")) for video in videos]
    return [f"{name}_" for name in (distinct(names) if distinct(stems) != stems else stems)]


def _input_warnings(
    videos: Sequence[Path], cut: Set[Path], skipped: Sequence[str]
) -> Iterator[str]:
    for video in videos:
        if video in cut:
            yield (
                f"{video.name} shows all directions: {len(DIRECTIONS)} views are cut from each"
                " frame"
            )
    if skipped:
        yield f"skipped, since {FEWEST_PHOTOGRAPHS} are needed: {', '.join(skipped)}"


def _warnings(
    videos: Sequence[Path],
    motions: Sequence[FrameMotion],
    chosen: Sequence[Sequence[int]],
    count: int,
) -> Iterator[str]:
    for video, motion, frames in zip(videos, motions, chosen, strict=True):
        taken = np.array(frames, dtype=np.int64)
        yield from clip_warnings(video.name, motion, declared_duration_s(video), taken)
    total = sum(map(len, chosen))
    if total < count:
        names = ", ".join(video.name for video in videos)
        gives = "gives" if len(videos) == 1 else "give"
        yield f"{names} {gives} {total} frames that differ, not {count}"
