"""Masks of clips: videos, or folders of PNG files, one a frame."""

from functools import partial

import av
import numpy as np
import pytest
from expected_errors import rejects
from made_photographs import encoded, texture
from message_words import mentions

from styletrf.capture.capture_file import read_capture
from styletrf.capture.clips.clip_masks import masks_of_frames, require_masks_of_clips
from styletrf.capture.clips.video_capture import capture_videos
from styletrf.capture.mask_files import find_clip_masks
from styletrf.capture.masks import mask_of_view
from styletrf.files.images import read_rgb
from styletrf.files.video import write_video
from styletrf.files.video_frames import video_frames, video_info
from styletrf.steps.sources.scene_capture import capture_scene
from styletrf.steps.step_run import StepRun

COUNT, WIDTH, HEIGHT, STEP = 10, 96, 64, 8
FRAMES = [texture(HEIGHT, 2 * WIDTH)[:, STEP * k : STEP * k + WIDTH] for k in range(COUNT)]


def counted(index):
    """The pixels of a frame that count: a band that is elsewhere in each frame."""
    columns = np.arange(WIDTH) // STEP
    return np.tile(columns <= index, (HEIGHT, 1))


def gray(counts, black=0, white=255):
    """A frame of a mask."""
    return np.where(counts, white, black).astype(np.uint8)[..., None].repeat(3, axis=2)


def put_mask(place, frames, rate=12):
    """Writes a mask as a video, or as a folder where the place has no suffix."""
    place.parent.mkdir(exist_ok=True)
    if place.suffix:
        return write_video(place, frames, rate)
    place.mkdir()
    for index, frame in enumerate(frames, start=1):
        (place / f"frame_{index}.png").write_bytes(encoded(frame, ".png"))
    return None


@pytest.fixture
def clip(tmp_path):
    """A camera that moves along a wall."""
    (tmp_path / "scenes/walk").mkdir(parents=True)
    write_video(tmp_path / "scenes/walk/a.mp4", FRAMES, 12)
    return tmp_path / "scenes/walk/a.mp4"


def captured(clips, out, **settings):
    """The capture of clips with the masks beside them."""
    masks = find_clip_masks(clips[0].parent, clips)
    return capture_videos(clips, out, 6, masks=masks, **settings)


@pytest.mark.parametrize(
    ("name", "rate"), [("a.mp4", 12), ("a.MKV", 30), ("a.mp4.webm", 5), ("a", 12)]
)
def test_a_chosen_frame_has_the_mask_of_its_index_whatever_the_times_of_the_mask(
    clip, tmp_path, name, rate
):
    mask = [gray(counted(k), 90, 170) for k in range(COUNT)]
    put_mask(clip.parent / "masks" / name, mask, rate)
    data, out = tmp_path, tmp_path / "out"
    capture_scene({}, out, {"video_frames": 6}, StepRun(tmp_path), data=data, scene="walk")
    capture = read_capture(out)
    assert len(capture.photographs) == 6
    for photograph in capture.photographs:
        counts = mask_of_view(out / "images", photograph.name)
        assert np.array_equal(counts, counted(round(12 * photograph.time_s)))
        assert set(np.unique(read_rgb(out / f"masks/{photograph.name}.png"))) == {0, 1}
    assert not any("mask" in warning for warning in capture.warnings)


def test_frames_of_a_clip_are_the_same_with_and_without_its_mask(clip, tmp_path):
    plain = captured([clip], tmp_path / "plain")
    assert not (tmp_path / "plain/masks").exists()
    put_mask(clip.parent / "masks/a.mp4", [gray(counted(k)) for k in range(COUNT)])
    assert captured([clip], tmp_path / "masked") == plain


def test_a_clip_without_a_mask_beside_one_that_has_it_counts_whole(clip, tmp_path):
    write_video(clip.with_name("b.mp4"), FRAMES, 12)
    put_mask(clip.parent / "masks/b", [gray(counted(k)) for k in range(COUNT)])
    capture = captured([clip, clip.with_name("b.mp4")], tmp_path / "out")
    masked = {path.stem for path in (tmp_path / "out/masks").iterdir()}
    assert masked == {one.name for one in capture.photographs if one.clip == "b.mp4"}
    assert masked < {one.name for one in capture.photographs}


@pytest.mark.parametrize("name", ["a.mp4", "a"])
@pytest.mark.parametrize("count", [COUNT - 1, COUNT + 1])
def test_a_mask_with_another_number_of_frames_is_refused_before_its_clip_is_followed(
    clip, tmp_path, name, count
):
    put_mask(clip.parent / "masks" / name, [gray(counted(k)) for k in range(count)])
    steps = []
    with rejects(clip.parent / "masks" / name, count, COUNT):
        captured([clip], tmp_path / "out", progress=lambda done, _: steps.append(done))
    assert steps == []
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("codec", "pixels"), [("qtrle", "argb"), ("png", "rgba")])
def test_a_mask_video_with_alpha_is_refused(clip, tmp_path, codec, pixels):
    """Its mask may be the alpha, which nothing read: all pixels counted."""
    mask = tmp_path / "a.mov"
    with av.open(str(mask), "w") as container:
        stream = container.add_stream(codec, 12, width=WIDTH, height=HEIGHT, pix_fmt=pixels)
        for _ in range(COUNT):
            frame = av.VideoFrame.from_ndarray(np.full((HEIGHT, WIDTH, 4), 255, np.uint8), "rgba")
            container.mux(stream.encode(frame.reformat(format=pixels)))
        container.mux(stream.encode())
    with rejects("a.mov", "alpha"):
        require_masks_of_clips({clip: mask})


@pytest.mark.parametrize("gone", [3, 9])
def test_a_folder_of_masks_with_a_gap_is_refused_although_another_file_fills_it(
    clip, tmp_path, gone
):
    """All frames behind the gap had the mask of their neighbor."""
    put_mask(tmp_path / "a", [gray(counted(k)) for k in range(COUNT)])
    (tmp_path / f"a/frame_{gone}.png").rename(tmp_path / "a/overview.png")
    with rejects("a", "after"):
        require_masks_of_clips({clip: tmp_path / "a"})


@pytest.mark.parametrize("name", ["a.mp4", "a"])
def test_a_mask_of_another_size_is_refused_before_its_clip_is_followed(clip, tmp_path, name):
    lying = [gray(counted(k)).swapaxes(0, 1) for k in range(COUNT)]
    put_mask(clip.parent / "masks" / name, lying)
    steps = []
    with rejects(clip.parent / "masks" / name, f"{HEIGHT}x{WIDTH}", f"{WIDTH}x{HEIGHT}"):
        captured([clip], tmp_path / "out", progress=lambda done, _: steps.append(done))
    assert steps == []


def test_a_frame_of_a_mask_that_has_another_size_than_the_first_is_refused(clip, tmp_path):
    masks = [gray(counted(k)) for k in range(COUNT)]
    put_mask(clip.parent / "masks/a", [*masks[:-1], masks[-1][1:]])
    with rejects(clip.parent / "masks/a", f"{WIDTH}x{HEIGHT - 1}"):
        captured([clip], tmp_path / "out")


@pytest.mark.parametrize("name", ["a.mp4", "a"])
@pytest.mark.parametrize("count", [COUNT - 1, COUNT + 1])
def test_masks_of_frames_end_with_an_error_where_the_mask_has_more_or_fewer(tmp_path, name, count):
    put_mask(tmp_path / name, [gray(counted(k)) for k in range(count)])
    masks = masks_of_frames(tmp_path / name, {0, 3}, COUNT)
    assert [np.array_equal(next(masks)[..., 0] > 0, counted(k)) for k in (0, 3)] == [True, True]
    with rejects(tmp_path / name, count, COUNT):
        next(masks)


def test_masks_of_frames_are_decoded_for_the_frames_alone_that_are_taken(tmp_path):
    """A folder of thousands of files would be read for sixty."""
    put_mask(tmp_path / "a", [gray(counted(k)) for k in range(COUNT)])
    for unread in (1, 3, 9):
        (tmp_path / f"a/frame_{unread}.png").write_bytes(b"no image")
    assert len(list(masks_of_frames(tmp_path / "a", {1, 3, 9}, COUNT))) == 3


def test_the_mask_of_a_clip_cut_short_has_the_frames_that_can_be_decoded(tmp_path):
    """The file has more packets than frames that can be seen."""
    clip, mask = tmp_path / "a.mp4", tmp_path / "mask.mp4"
    write_video(clip, FRAMES, 12)
    content = clip.read_bytes()
    clip.write_bytes(content[: content.index(b"mdat") + 3 * len(content) // 4])
    frames = list(video_frames(clip))
    assert 0 < len(frames) < video_info(clip).frames
    write_video(mask, frames, 12)
    require_masks_of_clips({clip: mask})
    write_video(mask, frames[1:], 12)
    with rejects(mask, len(frames) - 1, len(frames)):
        require_masks_of_clips({clip: mask})


@pytest.mark.parametrize("degrees", [90, -90])
def test_the_mask_of_a_clip_filmed_upright_is_upright(tmp_path, degrees):
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.set_display_rotation(degrees)
        for frame in FRAMES[:3]:
            pixels = np.ascontiguousarray(frame)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        container.mux(stream.encode(None))
    masks = [gray(counted(k)) for k in range(3)]
    put_mask(tmp_path / "upright.mp4", [np.rot90(mask) for mask in masks])
    require_masks_of_clips({tmp_path / "a.mp4": tmp_path / "upright.mp4"})
    put_mask(tmp_path / "lying.mp4", masks)
    with rejects(tmp_path / "lying.mp4", f"{WIDTH}x{HEIGHT}"):
        require_masks_of_clips({tmp_path / "a.mp4": tmp_path / "lying.mp4"})


@pytest.mark.parametrize(("hidden", "left"), [(1, 5), (4, None)])
def test_frames_that_are_masked_all_over_are_left_out_unless_too_few_are_left(
    clip, tmp_path, hidden, left
):
    taken = [round(12 * one.time_s) for one in captured([clip], tmp_path / "all").photographs]
    masks = [gray(counted(k if k in taken[hidden:] else -1)) for k in range(COUNT)]
    put_mask(clip.parent / "masks/a.mp4", masks)
    capture = partial(captured, [clip], tmp_path / "out")
    if left is None:
        with rejects(clip, len(taken) - hidden):
            capture()
        return
    seen = capture()
    assert [one.name for one in seen.photographs] == [f"{k:04d}" for k in range(2, 2 + left)]
    assert sum(mentions(warning, "0001") for warning in seen.warnings) == 1
    for folder in ("images", "masks"):
        assert len(list((tmp_path / "out" / folder).iterdir())) == left


def test_masks_that_fit_no_clip_have_a_warning(clip, tmp_path):
    put_mask(clip.parent / "masks/b.mp4", [gray(counted(k)) for k in range(3)])
    (clip.parent / "masks/0001.png").write_bytes(encoded(gray(counted(0)), ".png"))
    warnings = captured([clip], tmp_path / "out").warnings
    unused = "walk/masks/b.mp4", "walk/masks/0001.png"
    assert sum(mentions(warning, *unused) for warning in warnings) == 1
