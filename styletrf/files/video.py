"""Videos that every browser plays: H.264 (or VP9) in MP4.

PyAV encodes them, and not OpenCV, whose wheel has no H.264 encoder and leaves neither the quality
nor the color matrix to choose.
"""

import math
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.video.reformatter import (
    ColorPrimaries,
    ColorRange,
    Colorspace,
    ColorTrc,
    Interpolation,
    VideoReformatter,
)

from styletrf.errors import InputError
from styletrf.files.atomic_write import atomic_write
from styletrf.files.video_frames import Frame

# In order of preference. Constant quality, at which painted strokes survive (32 dB and more on pans
# over the paintings of the paper); one thread, since the number of threads changes the bytes; no
# macroblock tree, whose code for wide registers reads beyond small frames: bytes as they come.
_ENCODERS = {
    "libx264": {"crf": "16", "preset": "slow", "threads": "1", "x264-params": "mbtree=0"},
    "libvpx-vp9": {"crf": "18", "b": "0", "deadline": "good", "cpu-used": "2", "threads": "1"},
}


def write_video(path: Path, frames: Iterable[Frame], frames_per_second: float | int) -> None:
    """Writes RGB frames as MP4; the same frames and encoder give the same bytes.

    Browsers decode 4:2:0 only, so color has half the resolution of brightness, and a frame of odd
    width or height gets its last column or row repeated. Frames are taken one at a time.

    Raises:
        InputError: There are no frames, they differ in size, the rate is not positive, or the
            installed PyAV encodes neither H.264 nor VP9.
    """
    if not 0 < frames_per_second < math.inf:
        raise InputError(f"{frames_per_second} frames a second", "is no rate", "Use 24 or so")
    iterator = iter(frames)
    first = next(iterator, None)
    if first is None:
        raise InputError(str(path), "would be a video without frames", "Give at least one frame")
    with atomic_write(path) as partial:
        _encode(partial, first, iterator, Fraction(frames_per_second).limit_denominator(1001))


def _encode(path: Path, first: Frame, others: Iterator[Frame], rate: Fraction) -> None:
    height, width = (side + side % 2 for side in first.shape[:2])
    options = {"movflags": "+faststart", "fflags": "+bitexact"}  # plays while loading; no dates
    with av.open(str(path), "w", format="mp4", options=options) as container:
        encoder = available_encoder()
        added = container.add_stream(encoder, rate=rate, options=dict(_ENCODERS[encoder]))
        stream = cast(av.VideoStream, added)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        _tag_colors(stream.codec_context)
        reformatter = VideoReformatter()
        for index, frame in enumerate(_same_sized(path, first, others)):
            picture = _yuv(frame, reformatter)
            picture.pts = index
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


def available_encoder() -> str:
    """Returns the encoder that `write_video` uses here.

    Raises:
        InputError: The installed PyAV has none that browsers can play.
    """
    for name in _ENCODERS:
        try:
            av.Codec(name, "w")
        except ValueError:
            continue
        return name
    raise InputError(
        "PyAV", f"has none of the encoders {', '.join(_ENCODERS)}", "Install its published wheel"
    )


def _tag_colors(context: av.VideoCodecContext) -> None:
    """Tags the color space; without tags, each player guesses it from the size of the frame."""
    context.colorspace = Colorspace.ITU601
    context.color_range = ColorRange.MPEG
    context.color_primaries = ColorPrimaries.BT709
    context.color_trc = ColorTrc.IEC61966_2_1


def _yuv(frame: Frame, reformatter: VideoReformatter) -> av.VideoFrame:
    height, width = frame.shape[:2]
    even = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return reformatter.reformat(
        av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24"),
        format="yuv420p",
        dst_colorspace=Colorspace.ITU601,
        dst_color_range=ColorRange.MPEG,
        interpolation=Interpolation.BICUBIC
        | Interpolation.FULL_CHR_H_INP
        | Interpolation.ACCURATE_RND,
    )


def _same_sized(path: Path, first: Frame, others: Iterator[Frame]) -> Iterator[Frame]:
    yield first
    for index, frame in enumerate(others, start=1):
        if frame.shape != first.shape:
            raise InputError(
                f"frame {index} of {path.name}", "differs in size from the first", "Use one size"
            )
        yield frame
