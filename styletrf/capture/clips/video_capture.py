"""Videos of one scene as a capture: the frames that serve best as photographs.

`frame_choice` chooses them. Several clips share the frames by the length of the way that each goes.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from itertools import islice
from pathlib import Path

import numpy as np

from styletrf.capture.capture_file import Capture, Photograph, write_capture
from styletrf.capture.capture_warnings import listed, warnings_of_masks
from styletrf.capture.clips.clip_masks import require_masks_of_clips
from styletrf.capture.clips.clip_survey import clip_warnings
from styletrf.capture.clips.frame_choice import chosen_frames
from styletrf.capture.clips.frame_motion import (
    FrameMotion,
    examined_size,
    frame_motion,
    joined_motion,
)
from styletrf.capture.clips.frame_writing import decoded_frames, written_frames
from styletrf.capture.left_out import left_out, names_of_frame
from styletrf.capture.mask_files import NO_MASKS, FoundMasks
from styletrf.capture.panorama.panorama_views import DIRECTIONS
from styletrf.capture.panorama.panoramas import (
    Choice,
    has_panorama_shape,
    panorama_mismatch,
    require_all_directions,
    show_panoramas,
)
from styletrf.capture.photograph_names import distinct, shortened
from styletrf.capture.photographs import FEWEST_PHOTOGRAPHS
from styletrf.errors import InputError
from styletrf.files.video_frames import (
    TimedFrame,
    declared_duration_s,
    first_frame,
    timed_frames,
    video_info,
)
from styletrf.progress import Progress, silent

_LOOKED_AT, _EVERY = 10, 30  # frames that decide whether a clip is of panoramas


def capture_videos(
    videos: Sequence[Path],
    out_dir: Path,
    count: int,
    progress: Progress = silent,
    panoramas: Choice = "auto",
    leave_out: Sequence[str] = (),
    skipped: Sequence[str] = (),
    masks: FoundMasks = NO_MASKS,
) -> Capture:
    """Writes at most `count` frames of a scene's videos as `images/*.png`, and `capture.json`.

    Frames of a single video are named `0001` and so on, those of several `NAME_0001`. Each has its
    clip, its time there and the number of cuts before it. Frames that are panoramas are replaced by
    views cut from them, and each view counts. Of the frames that were chosen those named by
    `leave_out` are not written (see `styletrf.capture.left_out`), nor those that `masks` cover
    completely; the others keep their names, and their masks are `masks/<name>.png`. A warning names
    the photographs beside the videos that are `skipped`.

    Raises:
        InputError: A file is no video, its pictures change their shape or keep still, a mask does
            not fit its clip, there are fewer than three frames to choose from or left, or nothing
            to leave out by such a name.
    """
    cut = {video for video in videos if _is_panorama(video, panoramas)}
    require_masks_of_clips(masks.by_picture)
    motions = [frame_motion(_followed(video, progress)) for video in videos]
    views = [len(DIRECTIONS) if video in cut else 1 for video in videos]
    most, chosen = _most_frames(motions, views, count)
    total = sum(len(frames) for frames in chosen)
    _require_enough(videos, total, "Film longer, or ask for more frames")
    taken = _not_left_out(_named(videos, chosen), leave_out)
    _require_enough(videos, sum(map(len, taken)), "Leave out fewer")
    photographs = [
        kept
        for video, clip, motion, names in zip(
            videos, _clip_names(videos), motions, taken, strict=True
        )
        for kept in written_frames(
            decoded_frames(video, clip, motion, names, masks.by_picture.get(video)),
            out_dir,
            is_panorama=video in cut,
        )
    ]
    hidden = _hidden(taken, photographs) if masks.by_picture else []
    _require_enough(videos, sum(map(len, taken)) - len(hidden), "Leave more of the masks white")
    warnings = [
        *_input_warnings(videos, cut, skipped),
        *_mask_warnings(masks, hidden),
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


def _hidden(taken: Sequence[Mapping[int, str]], kept: Sequence[Photograph]) -> list[str]:
    """Returns the names of the frames that were taken, and of which nothing is kept."""
    seen = {photograph.panorama or photograph.name for photograph in kept}
    return [name for names in taken for name in names.values() if name not in seen]


def _clip_names(videos: Sequence[Path]) -> list[str]:
    """Returns the names of the files, with numbers where files in several folders share one."""
    return distinct([video.name for video in videos])


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


def _mask_warnings(masks: FoundMasks, hidden: Sequence[str]) -> Iterator[str]:
    yield from warnings_of_masks(masks, "video")
    if hidden:
        yield f"left out, since their masks are black all over: {listed(hidden)}"


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
