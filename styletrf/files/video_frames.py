"""Frames of videos: decoded, upright, at the times they are shown."""

import re
from collections.abc import Iterator, Set
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.buffer import Buffer
from av.video.reformatter import Colorspace
from jaxtyping import UInt8

from styletrf.errors import InputError
from styletrf.files.colors.high_dynamic_range import HLG, PQ, srgb_from_hdr

Frame = UInt8[np.ndarray, "height width 3"]

_UNSPECIFIED = 2  # FFmpeg's AVCOL_SPC_UNSPECIFIED
_HD_COLUMNS, _SD_LINES = 1280, 576
_CLOCK = re.compile(r"(\d+):(\d+):(\d+(?:\.\d+)?)")


@dataclass(frozen=True, slots=True)
class VideoInfo:
    """The properties of a video file; `codec` is FFmpeg's name (h264, vp9)."""

    codec: str
    width: int
    height: int
    frames: int
    frames_per_second: float


@dataclass(frozen=True, slots=True)
class TimedFrame:
    """A decoded frame, and when it is shown, in seconds since the first.

    The frame is equirectangular where the file has spherical metadata that say so.
    """

    time_s: float
    pixels: Frame
    is_equirectangular: bool = False


def video_info(path: Path) -> VideoInfo:
    """Returns size, rate and number of frames, counted rather than believed.

    Raises:
        InputError: The file is missing or holds no video.
    """
    with _opened(path) as container:
        stream = _picture_of(container)
        count = 0
        with suppress(av.FFmpegError):  # where the file is cut short
            for packet in container.demux(stream):
                count += packet.size > 0
        rate = float(stream.average_rate or 0)
        context = stream.codec_context
        return VideoInfo(context.name, context.width, context.height, count, rate)


def has_alpha(path: Path) -> bool:
    """Returns whether the frames of a video have an alpha channel, which `timed_frames` drops.

    Raises:
        InputError: The file is missing or holds no video.
    """
    with _opened(path) as container:
        stored = _picture_of(container).codec_context.format
        return bool(stored and any(component.is_alpha for component in stored.components))


def video_frames(path: Path) -> Iterator[Frame]:
    """Yields the decoded frames as RGB, one at a time, upright as the phone that filmed was held.

    Raises:
        InputError: As `timed_frames`.
    """
    for frame in timed_frames(path):
        yield frame.pixels


def first_frame(path: Path) -> TimedFrame:
    """Returns the first frame of `timed_frames`.

    Raises:
        InputError: As `timed_frames`, or no frame can be decoded.
    """
    for frame in timed_frames(path):
        return frame
    raise InputError(str(path), "holds no frame that can be decoded", "Copy it again")


def timed_frames(path: Path, indices: Set[int] | None = None) -> Iterator[TimedFrame]:
    """Yields the frames of `video_frames` with their times, which need not be evenly spaced.

    Damaged frames are left out, and decoding ends where the file is cut short: compare the last
    time with `declared_duration_s`. With `indices`, only the frames at these places are yielded;
    the others are decoded, but not converted.

    Raises:
        InputError: The file is missing or holds no video, or frames in a color space that cannot be
            converted.
    """
    with _opened(path) as container:
        interval_s = 1 / float(_picture_of(container).average_rate or 24)
        start_s, shown_s = None, -interval_s
        for index, frame in enumerate(_decodable(container)):
            shown_s = shown_s + interval_s if frame.pts is None else float(frame.time)
            start_s = shown_s if start_s is None else start_s
            if indices is not None and index not in indices:
                continue
            pixels = np.rot90(_rgb(frame, path), round(frame.rotation / 90))
            upright = np.ascontiguousarray(pixels)
            yield TimedFrame(shown_s - start_s, upright, _is_equirectangular(frame))


def _rgb(frame: av.VideoFrame, path: Path) -> Frame:
    """Returns the pixels of a frame as they are stored; those of HDR up to diffuse white.

    Raises:
        InputError: FFmpeg cannot convert them, as those in YCgCo or BT.2020 of constant luminance.
    """
    is_hdr = frame.color_trc in (PQ, HLG)
    stored = "rgb48le" if is_hdr else "rgb24"
    try:
        pixels = frame.to_ndarray(format=stored, src_colorspace=_assumed_colorspace(frame))
    except av.FFmpegError as error:
        problem = f"has a color space that cannot be converted to RGB ({error.strerror})"
        raise InputError(str(path), problem, "Convert the video to BT.709") from error
    return srgb_from_hdr(pixels, frame.color_trc) if is_hdr else pixels


def _assumed_colorspace(frame: av.VideoFrame) -> Colorspace | None:
    """Returns the color space to assume for a frame that names none; None if it names one.

    That of HDR is BT.2020. Of other frames, it is BT.709 from 1280 columns or 577 lines on, as
    players assume. FFmpeg would assume BT.601, which makes red darker and browner.
    """
    if frame.colorspace != _UNSPECIFIED or not frame.format.name.startswith("yuv"):
        return None
    if frame.color_trc in (PQ, HLG):
        return Colorspace.BT2020
    is_hd = frame.width >= _HD_COLUMNS or frame.height > _SD_LINES
    return Colorspace.ITU709 if is_hd else None


def _is_equirectangular(frame: av.VideoFrame) -> bool:
    """Returns whether FFmpeg's `AVSphericalMapping` begins with the equirectangular projection."""
    spherical = frame.side_data.get("SPHERICAL")
    return isinstance(spherical, Buffer) and bytes(spherical)[:4] == bytes(4)


def declared_duration_s(path: Path) -> float | None:
    """Returns how long the file says that its picture lasts; None where it says nothing.

    Raises:
        InputError: The file is missing or holds no video.
    """
    with _opened(path) as container:
        return _duration_s(container)


def _duration_s(container: av.container.InputContainer) -> float | None:
    """Returns how long a file says that its picture lasts; its sound may last longer.

    Matroska and WebM give the duration of the whole file, and that of a stream as a tag.
    """
    stream = _picture_of(container)
    if stream.duration is not None and stream.time_base is not None:
        return float(stream.duration * stream.time_base)
    if len(container.streams) == 1:
        return _whole_duration_s(container)
    tags = [text for tag, text in stream.metadata.items() if tag.startswith("DURATION")]
    if not tags or not (times := _CLOCK.fullmatch(tags[0])):
        return None
    hours, minutes, seconds = map(float, times.groups())
    return 3600 * hours + 60 * minutes + seconds


def _whole_duration_s(container: av.container.InputContainer) -> float | None:
    return None if container.duration is None else container.duration / av.time_base


def declared_frames(path: Path) -> int:
    """Returns how many frames the file says that it holds, or else by its duration and rate.

    The number is 0 where it says neither. Only the head of the file is read.

    Raises:
        InputError: The file is missing or holds no video.
    """
    with _opened(path) as container:
        stream = _picture_of(container)
        if stream.frames:
            return int(stream.frames)
        duration_s = _duration_s(container) or _whole_duration_s(container) or 0.0
        return round(duration_s * float(stream.average_rate or 0))


def decodable_frames(path: Path) -> int:
    """Returns how many frames `timed_frames` yields, by decoding all of them.

    Raises:
        InputError: The file is missing or holds no video.
    """
    with _opened(path) as container:
        return sum(1 for _ in _decodable(container))


def _decodable(container: av.container.InputContainer) -> Iterator[av.VideoFrame]:
    """Yields the undamaged frames up to where the file can be read no further."""
    with suppress(av.FFmpegError):
        for packet in container.demux(_picture_of(container)):
            with suppress(av.FFmpegError):  # behind a damaged packet decoding goes on
                yield from (frame for frame in packet.decode() if not frame.is_corrupt)


def _opened(path: Path) -> av.container.InputContainer:
    try:
        container = av.open(str(path))
    except (av.FFmpegError, OSError) as error:
        raise InputError(str(path), "cannot be read as a video", "Check the file") from error
    if not container.streams.video:
        container.close()
        raise InputError(str(path), "holds no video", "Give a video file")
    return container


def _picture_of(container: av.container.InputContainer) -> av.VideoStream:
    """Returns the stream that players show, which need not be the first: that may be a cover."""
    best = container.streams.best("video")
    return best if isinstance(best, av.VideoStream) else container.streams.video[0]
