"""A video of the courtyard as a capture."""

import av
import cv2
import numpy as np
import pytest
from expected_errors import rejects
from message_words import mentions

from styletrf.capture.capture_file import read_capture
from styletrf.capture.clips.video_capture import capture_videos
from styletrf.errors import InputError
from styletrf.files.images import read_rgb
from styletrf.files.video import write_video
from styletrf.files.video_frames import timed_frames, video_frames
from styletrf.geometry.cameras import Camera
from styletrf.steps.sources.scene_capture import capture_scene
from styletrf.steps.step_run import StepRun
from styletrf.synthetic.courtyard.capture import CourtyardConfig, render_view
from styletrf.synthetic.courtyard.paths import looking_at

SIZE = (160, 120)


def filmed(centers, targets):
    """What a camera sees that goes so."""
    poses = looking_at(centers, targets, np.random.default_rng(1))
    width, height = SIZE
    config = CourtyardConfig(width=width, height=height)
    intrinsics = (0.85 * width, 0.85 * width, width / 2, height / 2)
    cameras = [Camera("", width, height, *intrinsics, pose) for pose in poses]
    return [render_view(camera, config)[0] for camera in cameras]


@pytest.fixture(scope="module")
def walk():
    t = np.linspace(-1, 1, 24)[:, None]
    return filmed(t * [1.0, 0, 0] + [0, -3.5, 1.6], np.repeat([[0, 2.0, 1.0]], 24, axis=0))


def test_frames_of_a_walk_are_photographs(walk, tmp_path):
    write_video(tmp_path / "walk.mp4", walk, 12)
    capture = capture_videos([tmp_path / "walk.mp4"], tmp_path / "out", 8)
    assert capture == read_capture(tmp_path / "out")
    assert capture.warnings == ()
    assert [photograph.name for photograph in capture.photographs] == [
        f"{number:04d}" for number in range(1, 9)
    ]
    frames = list(video_frames(tmp_path / "walk.mp4"))
    for photograph in capture.photographs:
        image = np.rint(255 * read_rgb(tmp_path / "out" / "images" / photograph.file))
        assert np.abs(image - frames[round(12 * photograph.time_s)]).max() == 0
        assert (photograph.clip, photograph.shot) == ("walk.mp4", 0)


def test_several_clips_are_one_scene_and_each_frame_knows_its_clip(walk, tmp_path):
    for name, frames in {"b.mp4": walk[:15], "a.webm": walk[10:]}.items():
        write_video(tmp_path / name, frames, 12)
    clips = [tmp_path / "a.webm", tmp_path / "b.mp4"]
    capture = capture_videos(clips, tmp_path / "out", 12)
    assert capture == read_capture(tmp_path / "out")
    assert {photograph.clip for photograph in capture.photographs} == {"a.webm", "b.mp4"}
    names = [photograph.name for photograph in capture.photographs]
    assert names == sorted(names)
    assert {"a_0001", "b_0001"} <= set(names)
    order = [(photograph.clip, photograph.time_s) for photograph in capture.photographs]
    assert order == sorted(order)


def test_frames_are_left_out_by_their_names_and_the_others_stay_as_they_are(walk, tmp_path):
    """The setting was ignored for videos."""
    write_video(tmp_path / "walk.mp4", walk, 12)
    every = capture_videos([tmp_path / "walk.mp4"], tmp_path / "every", 8).photographs
    leave_out = ["0002", "0005.png", "*8"]
    few = capture_videos([tmp_path / "walk.mp4"], tmp_path / "few", 8, leave_out=leave_out)
    assert few.photographs == tuple(every[k] for k in (0, 2, 3, 5, 6))
    assert {path.stem for path in (tmp_path / "few/images").iterdir()} == {
        photograph.name for photograph in few.photographs
    }
    assert few.warnings == ()


def test_the_setting_of_a_scene_leaves_out_frames_of_its_video(walk, tmp_path):
    (tmp_path / "scenes").mkdir()
    write_video(tmp_path / "scenes/walk.mp4", walk, 12)
    (tmp_path / "out").mkdir()
    settings = {"video_frames": 5, "leave_out": ["0002"]}
    capture_scene({}, tmp_path / "out", settings, StepRun(tmp_path), data=tmp_path, scene="walk")
    names = [photograph.name for photograph in read_capture(tmp_path / "out").photographs]
    assert names == ["0001", "0003", "0004", "0005"]


def test_photographs_beside_a_clip_that_are_too_few_are_named_in_a_warning(walk, tmp_path):
    folder = tmp_path / "scenes" / "walk"
    folder.mkdir(parents=True)
    write_video(folder / "walk.mp4", walk, 12)
    (folder / "plan.jpg").touch()
    settings = {"video_frames": 5}
    capture_scene({}, tmp_path / "out", settings, StepRun(tmp_path), data=tmp_path, scene="walk")
    assert [warning for warning in read_capture(tmp_path / "out").warnings if "plan.jpg" in warning]


@pytest.mark.parametrize("leave_out", [["0009"], ["*"]])
def test_frames_that_are_not_there_or_all_frames_cannot_be_left_out(walk, tmp_path, leave_out):
    write_video(tmp_path / "walk.mp4", walk, 12)
    with pytest.raises(InputError):
        capture_videos([tmp_path / "walk.mp4"], tmp_path / "out", 8, leave_out=leave_out)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("names", [("a.mp4", "a.webm"), ("a.b.mp4", "a_b.mp4", "A_B.webm")])
def test_clips_of_almost_one_name_keep_their_frames_apart(walk, tmp_path, names):
    clips = [tmp_path / name for name in names]
    for clip in clips:
        write_video(clip, walk, 12)
    photographs = capture_videos(clips, tmp_path / "out", 8).photographs
    assert len({photograph.name for photograph in photographs}) == len(photographs)


def test_clips_of_one_name_in_two_folders_are_two_clips(walk, tmp_path):
    """Frames were sorted by time as if they were of one clip, and matched with strangers."""
    clips = [tmp_path / "card1/clip.mp4", tmp_path / "card2/clip.mp4"]
    for clip in clips:
        clip.parent.mkdir()
        write_video(clip, walk, 12)
    photographs = capture_videos(clips, tmp_path / "out", 8).photographs
    assert len({photograph.clip for photograph in photographs}) == 2
    assert len({(one.clip, one.time_s) for one in photographs}) == len(photographs)


def test_clips_of_several_sizes_are_one_scene(walk, tmp_path):
    write_video(tmp_path / "a.mp4", walk, 12)
    write_video(tmp_path / "b.mp4", [frame[:100] for frame in walk], 12)
    clips = [tmp_path / "a.mp4", tmp_path / "b.mp4"]
    photographs = capture_videos(clips, tmp_path / "out", 8).photographs
    assert {(one.clip, one.height) for one in photographs} == {("a.mp4", 120), ("b.mp4", 100)}


def test_a_file_cut_short_is_used_as_far_as_it_goes(walk, tmp_path):
    write_video(tmp_path / "a.mp4", walk, 12)
    content = (tmp_path / "a.mp4").read_bytes()
    (tmp_path / "a.mp4").write_bytes(content[: 3 * len(content) // 4])
    capture = capture_videos([tmp_path / "a.mp4"], tmp_path / "out", 5)
    assert len(capture.photographs) == 5
    assert capture.photographs[-1].time_s < 1.7
    assert any(mentions(warning, "a.mp4", "2.0") for warning in capture.warnings)


def test_a_file_cut_short_before_three_frames_is_refused(walk, tmp_path):
    write_video(tmp_path / "a.mp4", walk, 12)
    content = (tmp_path / "a.mp4").read_bytes()
    (tmp_path / "a.mp4").write_bytes(content[: content.index(b"mdat") + 100])
    with rejects(tmp_path / "a.mp4", "frame"):
        capture_videos([tmp_path / "a.mp4"], tmp_path / "out", 5)


def test_a_clip_that_cannot_be_decoded_is_refused_before_the_others_are_followed(walk, tmp_path):
    for name in ("a.mp4", "b.mp4"):
        write_video(tmp_path / name, walk, 12)
    content = (tmp_path / "b.mp4").read_bytes()
    (tmp_path / "b.mp4").write_bytes(content[: content.index(b"mdat") + 100])
    clips, steps = [tmp_path / "a.mp4", tmp_path / "b.mp4"], []
    with pytest.raises(InputError) as refusal:
        capture_videos(clips, tmp_path / "out", 8, lambda done, total: steps.append(done))
    assert refusal.value.subject == str(tmp_path / "b.mp4")
    assert steps == []


@pytest.mark.parametrize(
    ("count", "subject", "value"), [(1, "the video", "2%"), (2, "a.mp4", "2 frames")]
)
def test_a_video_of_one_or_two_frames_is_refused(walk, tmp_path, count, subject, value):
    write_video(tmp_path / "a.mp4", walk[: 12 * count : 12], 12)
    with rejects(subject, value):
        capture_videos([tmp_path / "a.mp4"], tmp_path / "out", 8)


def test_a_clip_whose_picture_changes_its_shape_is_refused(walk, tmp_path):
    """It ended in a traceback of OpenCV."""
    for name, frames in {"a.ts": walk[:6], "b.ts": [frame[:, :120] for frame in walk[6:]]}.items():
        with av.open(str(tmp_path / name), "w", format="mpegts") as container:
            stream = container.add_stream("mpeg2video", 25)
            stream.height, stream.width = frames[0].shape[:2]
            for frame in frames:
                picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame))
                container.mux(stream.encode(picture.reformat(format="yuv420p")))
            container.mux(stream.encode(None))
    clip = tmp_path / "walk.mpg"
    clip.write_bytes((tmp_path / "a.ts").read_bytes() + (tmp_path / "b.ts").read_bytes())
    with rejects(clip, "120x120"):
        capture_videos([clip], tmp_path / "out", 8)


def test_times_are_those_of_the_file_where_frames_come_unevenly(walk, tmp_path):
    ticks = np.cumsum([0, 1, 1, 1, 7, 1, 3, 20, 1, 1])
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=10)
        stream.height, stream.width, stream.pix_fmt = 120, 160, "yuv420p"
        for tick, pixels in zip(ticks, walk, strict=False):
            frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
            frame.pts = int(tick)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    times_s = [frame.time_s for frame in timed_frames(tmp_path / "a.mp4")]
    np.testing.assert_allclose(times_s, ticks / 10, atol=1e-3)


def test_more_frames_than_there_are_have_a_warning(walk, tmp_path):
    write_video(tmp_path / "walk.webm", walk[:6], 12)
    capture = capture_videos([tmp_path / "walk.webm"], tmp_path / "out", 50)
    assert len(capture.photographs) == 6
    assert mentions(capture.warnings[0], "walk.webm", 6, 50)


def test_a_turn_on_the_spot_has_a_warning(tmp_path):
    angle = np.linspace(-0.5, 0.5, 12)
    center = np.array([0, -3.5, 1.6])
    ahead = np.stack([4 * np.sin(angle), 4 * np.cos(angle), 0 * angle - 0.5], axis=-1)
    write_video(tmp_path / "turn.mp4", filmed(np.repeat(center[None], 12, 0), center + ahead), 12)
    (warning,) = capture_videos([tmp_path / "turn.mp4"], tmp_path / "out", 8).warnings
    assert mentions(warning, "turn.mp4")
    assert "%" in warning


def test_a_blurred_video_has_a_warning(walk, tmp_path):
    blurred = [cv2.GaussianBlur(frame, (0, 0), 5.0) for frame in walk]
    write_video(tmp_path / "a.mp4", blurred, 12)
    write_video(tmp_path / "b.mp4", walk, 12)
    of_blurred, of_sharp = (
        capture_videos([tmp_path / name], tmp_path / f"out {name}", 8).warnings
        for name in ("a.mp4", "b.mp4")
    )
    assert len(of_blurred) == len(of_sharp) + 1


def test_what_is_no_video_is_refused(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"none")
    with rejects(tmp_path / "a.mp4", "video"):
        capture_videos([tmp_path / "a.mp4"], tmp_path / "out", 8)


@pytest.mark.parametrize("degrees", [0, 90, 180, -90])
def test_frames_are_upright_as_the_phone_was_held(tmp_path, degrees):
    """The top third of the scene is bright, however the sensor lay."""
    upright = np.zeros((96, 64, 3), np.uint8)
    upright[:32] = 255
    lying = np.ascontiguousarray(np.rot90(upright, -degrees // 90))
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=10)
        stream.height, stream.width = lying.shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.set_display_rotation(degrees)
        for _ in range(3):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(lying, format="rgb24")))
        container.mux(stream.encode(None))
    frames = list(video_frames(tmp_path / "a.mp4"))
    assert len(frames) == 3
    for frame in frames:
        assert frame.shape == upright.shape
        assert np.abs(frame.astype(int) - upright).mean() < 8
