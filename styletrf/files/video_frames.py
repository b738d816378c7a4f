"""Frames of videos: decoded, upright, at the times they are shown."""

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

Frame = UInt8[np.ndarray, "height width 3"]

_UNSPECIFIED = 2  # FFmpeg's AVCOL_SPC_UNSPECIFIED
_HD_COLUMNS, _SD_LINES = 1280, 576


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
        stream = container.streams.video[0]
        count = 0
        with suppress(av.FFmpegError):  # where the file is cut short
            for packet in container.demux(stream):
                count += packet.size > 0
        rate = float(stream.average_rate or 0)
        context = stream.codec_context
        return VideoInfo(context.name, context.width, context.height, count, rate)


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
        interval_s = 1 / float(container.streams.video[0].average_rate or 24)
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
    """Returns the pixels of a frame as they are stored.

    Raises:
        InputError: FFmpeg cannot convert them, as those in YCgCo or BT.2020 of constant luminance.
    """
    try:
        pixels: Frame = frame.to_ndarray(format="rgb24", src_colorspace=_assumed_colorspace(frame))
    except av.FFmpegError as error:
        problem = f"has a color space that cannot be converted to RGB ({error.strerror})"
        raise InputError(str(path), problem, "Convert the video to BT.709") from error
    return pixels


def _assumed_colorspace(frame: av.VideoFrame) -> Colorspace | None:
    """Returns the color space to assume for a frame that names none; None if it names one.

    From 1280 columns or 577 lines on that is BT.709, as players assume. FFmpeg would assume
    BT.601, which makes red darker and browner.
    """
    is_untagged = frame.colorspace == _UNSPECIFIED and frame.format.name.startswith("yuv")
    is_hd = frame.width >= _HD_COLUMNS or frame.height > _SD_LINES
    return Colorspace.ITU709 if is_untagged and is_hd else None


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
        stream = container.streams.video[0]
        if stream.duration is not None and stream.time_base is not None:
            return float(stream.duration * stream.time_base)
        return None if container.duration is None else container.duration / av.time_base


def declared_frames(path: Path) -> int:
    """Returns how many frames the file says that it holds, or else by its duration and rate.

    The number is 0 where it says neither. Only the head of the file is read.

    Raises:
        InputError: The file is missing or holds no video.
    """
    with _opened(path) as container:
        stream = container.streams.video[0]
        if stream.frames:
            return int(stream.frames)
        rate = float(stream.average_rate or 0)
    return round((declared_duration_s(path) or 0.0) * rate)


def _decodable(container: av.container.InputContainer) -> Iterator[av.VideoFrame]:
    """Yields the undamaged frames up to where the file can be read no further."""
    with suppress(av.FFmpegError):
        for packet in container.demux(container.streams.video[0]):
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
