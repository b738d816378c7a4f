import av
import cv2
import numpy as np
import pytest
from av.video.reformatter import Colorspace
from expected_errors import rejects

from styletrf.files.video import write_video
from styletrf.files.video_frames import (
    declared_duration_s,
    declared_frames,
    first_frame,
    timed_frames,
    video_frames,
    video_info,
)


def painted(height=96, width=128, count=8, seed=0):
    """A pan over patches of paint with brush lines: hard edges and fine texture."""
    random = np.random.default_rng(seed)
    shape = (height // 8 + 2, (width + count) // 8 + 2)
    patches = 0.7 * random.random((*shape, 1)) + 0.3 * random.random((*shape, 3))
    canvas = cv2.resize(patches, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    lines = cv2.GaussianBlur(random.normal(0, 1, canvas.shape[:2]), (0, 0), 3, sigmaY=0.7)
    canvas = np.clip(0.25 + 0.5 * canvas + 0.25 * lines[..., None], 0, 1)
    whole = np.rint(255 * canvas).astype(np.uint8)
    return [whole[:height, i : i + width] for i in range(count)]


def decoded_psnr(frames, path):
    height, width = frames[0].shape[:2]
    errors = [
        np.mean((a / 255 - b[:height, :width] / 255) ** 2)
        for a, b in zip(frames, video_frames(path), strict=True)
    ]
    return -10 * np.log10(max(errors))


def test_the_file_says_what_was_written(tmp_path):
    write_video(tmp_path / "a.mp4", painted(count=9), 24)
    info = video_info(tmp_path / "a.mp4")
    assert (info.width, info.height, info.frames) == (128, 96, 9)
    assert info.frames_per_second == 24
    assert info.codec in ("h264", "vp9")


@pytest.mark.parametrize("rate", [1, 12.5, 23.976, 60])
def test_the_frame_rate_of_a_video_is_kept(tmp_path, rate):
    write_video(tmp_path / "a.mp4", painted(32, 32, count=3), rate)
    assert video_info(tmp_path / "a.mp4").frames_per_second == pytest.approx(rate, rel=1e-4)


def test_painted_strokes_survive_the_encoding(tmp_path):
    frames = painted()
    write_video(tmp_path / "a.mp4", frames, 24)
    assert decoded_psnr(frames, tmp_path / "a.mp4") > 30
    gray = [
        np.repeat(frame.mean(axis=-1, keepdims=True), 3, -1).astype(np.uint8) for frame in frames
    ]
    write_video(tmp_path / "b.mp4", gray, 24)
    assert decoded_psnr(gray, tmp_path / "b.mp4") > 36


def test_some_frames_are_those_of_all_at_the_same_places_and_times(tmp_path):
    write_video(tmp_path / "a.mp4", painted(count=12), 24)
    every = list(timed_frames(tmp_path / "a.mp4"))
    some = list(timed_frames(tmp_path / "a.mp4", {0, 5, 11}))
    assert [frame.time_s for frame in some] == [every[k].time_s for k in (0, 5, 11)]
    assert all((a.pixels == every[k].pixels).all() for a, k in zip(some, (0, 5, 11), strict=True))


def untagged(path, color, height, width, matrix, tag=2):
    """Writes a video of one color whose file does not say what its numbers mean, or says this."""
    frame = np.full((height, width, 3), color, np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=24)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        picture = av.VideoFrame.from_ndarray(frame, "rgb24")
        picture = picture.reformat(format="yuv420p", dst_colorspace=matrix)
        stream.codec_context.colorspace = picture.colorspace = tag  # 2 is unspecified
        container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


@pytest.mark.parametrize(
    ("columns", "lines", "matrix"),
    [(640, 360, "ITU601"), (640, 720, "ITU709"), (1280, 544, "ITU709")],
)
def test_an_untagged_video_is_read_by_the_matrix_of_its_size(tmp_path, columns, lines, matrix):
    """Red of telephones' clips was brown: each was read as of standard definition."""
    untagged(tmp_path / "a.mp4", (200, 40, 40), lines, columns, Colorspace[matrix])
    pixels = first_frame(tmp_path / "a.mp4").pixels
    assert np.abs(pixels.astype(int) - [200, 40, 40]).max() <= 3


@pytest.mark.parametrize("color_space", [8, 10], ids=["YCgCo", "BT.2020 constant luminance"])
def test_a_video_whose_colors_cannot_be_converted_is_refused(tmp_path, color_space):
    """The command ended in a traceback before its first stage."""
    path = tmp_path / "a.mp4"
    untagged(path, (200, 40, 40), 48, 64, Colorspace.ITU709, color_space)
    with rejects(path, "color", remedy=["BT.709"]) as caught:
        first_frame(path)
    assert isinstance(caught.value.__cause__, av.FFmpegError)


def test_colors_of_a_video_come_back_within_three_levels(tmp_path):
    colors = np.uint8(
        [[200, 40, 40], [40, 200, 40], [40, 40, 200], [128, 128, 128], [255, 255, 255]]
    )
    frame = np.repeat(np.repeat(colors[None], 64, axis=0), 32, axis=1)
    write_video(tmp_path / "a.mp4", [frame] * 3, 24)
    frames = list(video_frames(tmp_path / "a.mp4"))
    assert len(frames) == 3
    for back in frames:
        middles = back[32, 16::32].astype(int)
        assert np.abs(middles - colors).max() <= 3


@pytest.mark.parametrize(("height", "width"), [(33, 50), (50, 33), (17, 19), (1, 1)])
def test_odd_sizes_gain_a_repeated_border(tmp_path, height, width):
    frames = painted(height, width, 3)
    write_video(tmp_path / "a.mp4", frames, 24)
    info = video_info(tmp_path / "a.mp4")
    assert (info.width, info.height) == (width + width % 2, height + height % 2)
    assert decoded_psnr(frames, tmp_path / "a.mp4") > 22


def test_the_same_frames_give_the_same_bytes(tmp_path):
    for name, seed in {"a": 0, "b": 0, "c": 1}.items():
        write_video(tmp_path / f"{name}.mp4", painted(seed=seed), 24)
    a, b, c = ((tmp_path / f"{name}.mp4").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_small_frames_give_the_same_bytes_every_time(tmp_path):
    """Of frames a few macroblocks wide, the encoder's tree of them read what lay beyond."""
    frames = painted(48, 64, 6)
    videos = set()
    for k in range(40):
        other_content_of_memory = np.full(1000 * (k + 1), k)
        write_video(tmp_path / "a.mp4", frames, 24)
        videos.add((tmp_path / "a.mp4").read_bytes())
        assert other_content_of_memory[0] == k
    assert len(videos) == 1


def test_the_index_comes_first_so_that_it_plays_while_loading(tmp_path):
    write_video(tmp_path / "a.mp4", painted(), 24)
    content = (tmp_path / "a.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


def test_frames_are_taken_one_at_a_time_and_a_failure_leaves_nothing(tmp_path):
    def broken():
        yield from painted(count=3)
        raise OSError("no more")

    with pytest.raises(OSError, match="no more"):
        write_video(tmp_path / "a.mp4", broken(), 24)
    assert list(tmp_path.iterdir()) == []


def test_a_video_that_cannot_be_written_or_read_is_refused(tmp_path):
    path = tmp_path / "a.mp4"
    with rejects(path, "frames"):
        write_video(path, [], 24)
    with rejects("frame 1"):
        write_video(path, [*painted(count=1), *painted(40, 40, 1)], 24)
    with rejects("0 frames a second"):
        write_video(path, painted(), 0)
    assert list(tmp_path.iterdir()) == []
    path.write_text("not a video")
    with rejects(path) as caught:
        video_info(path)
    assert isinstance(caught.value.__cause__, av.FFmpegError)
    with rejects(tmp_path / "missing.mp4") as caught:
        first_frame(tmp_path / "missing.mp4")
    assert isinstance(caught.value.__cause__, FileNotFoundError)


@pytest.mark.parametrize("count", [1, 7, 30])
def test_the_frames_that_a_file_declares_are_those_that_it_holds(tmp_path, count):
    write_video(tmp_path / "a.mp4", np.zeros((count, 16, 32, 3), np.uint8), 12)
    assert declared_frames(tmp_path / "a.mp4") == video_info(tmp_path / "a.mp4").frames == count


def clip_with_sound(path, seconds, sound_s):
    """Writes a clip of a gray picture whose sound lasts otherwise."""
    with av.open(str(path), "w") as container:
        picture, sound = container.add_stream("libx264", rate=10), container.add_stream("aac", 8000)
        picture.width, picture.height, picture.pix_fmt = 64, 48, "yuv420p"
        still = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 90, np.uint8), "rgb24")
        for index in range(10 * seconds):
            still.pts = index
            container.mux(picture.encode(still))
        silence = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.float32), "fltp", "mono")
        silence.sample_rate = 8000
        for index in range(sound_s):
            silence.pts = 8000 * index
            container.mux(sound.encode(silence))
        for stream in (picture, sound):
            container.mux(stream.encode(None))


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "mov"])
def test_a_picture_lasts_as_long_as_its_frames_also_beside_longer_sound(tmp_path, suffix):
    """A clip whose sound is longer was called cut short."""
    path = tmp_path / f"a.{suffix}"
    clip_with_sound(path, 2, 4)
    assert declared_duration_s(path) == pytest.approx(2, abs=0.15)
    assert declared_frames(path) == pytest.approx(video_info(path).frames, abs=1)


def test_a_cover_picture_before_the_video_is_not_its_first_frame(tmp_path):
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as container:
        cover, picture = container.add_stream("mjpeg", rate=1), container.add_stream("libx264", 24)
        cover.width, cover.height, cover.pix_fmt = 320, 180, "yuvj420p"
        cover.disposition = av.stream.Disposition.attached_pic
        picture.width, picture.height, picture.pix_fmt = 64, 48, "yuv420p"
        for stream, count in ((cover, 1), (picture, 5)):
            shape = stream.height, stream.width, 3
            still = av.VideoFrame.from_ndarray(np.full(shape, 90, np.uint8), "rgb24")
            for index in range(count):
                still.pts = index
                container.mux(stream.encode(still.reformat(format=stream.pix_fmt)))
            container.mux(stream.encode(None))
    assert [frame.pixels.shape for frame in timed_frames(path)] == [(48, 64, 3)] * 5
    assert (video_info(path).width, video_info(path).frames) == (64, 5)
