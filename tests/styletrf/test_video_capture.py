"""A video of the courtyard as a capture."""

import av
import cv2
import numpy as np
import pytest

from styletrf.cameras import Camera
from styletrf.courtyard.capture import CourtyardConfig, render_view
from styletrf.courtyard.paths import _looking_at
from styletrf.errors import InputError
from styletrf.images import read_rgb
from styletrf.scene_capture import read_capture
from styletrf.video import video_frames, write_video
from styletrf.video_capture import capture_video

SIZE = (160, 120)


def filmed(centers, targets):
    """What a camera sees that goes so."""
    poses = _looking_at(centers, targets, np.random.default_rng(1))
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
    capture = capture_video(tmp_path / "walk.mp4", tmp_path / "out", 8)
    assert capture == read_capture(tmp_path / "out")
    assert capture.warnings == ()
    assert [photograph.name for photograph in capture.photographs] == [
        f"{number:04d}" for number in range(1, 9)
    ]
    frames = list(video_frames(tmp_path / "walk.mp4"))
    for photograph in capture.photographs:
        image = np.rint(255 * read_rgb(tmp_path / "out" / "images" / photograph.file))
        assert min(np.abs(image - frame).max() for frame in frames) == 0, "it is one of them"


def test_more_frames_than_there_are_is_told(walk, tmp_path):
    write_video(tmp_path / "walk.webm", walk[:6], 12)
    capture = capture_video(tmp_path / "walk.webm", tmp_path / "out", 50)
    assert len(capture.photographs) == 6
    assert "gives 6 frames that differ, not 50" in capture.warnings[0]


def test_a_turn_on_the_spot_is_told(tmp_path):
    angle = np.linspace(-0.5, 0.5, 24)
    center = np.array([0, -3.5, 1.6])
    ahead = np.stack([4 * np.sin(angle), 4 * np.cos(angle), 0 * angle - 0.5], axis=-1)
    write_video(tmp_path / "turn.mp4", filmed(np.repeat(center[None], 24, 0), center + ahead), 12)
    (warning,) = capture_video(tmp_path / "turn.mp4", tmp_path / "out", 8).warnings
    assert "turn.mp4 hardly has parallax" in warning


def test_a_blurred_video_is_told(walk, tmp_path):
    blurred = [cv2.GaussianBlur(frame, (0, 0), 5.0) for frame in walk]
    write_video(tmp_path / "a.mp4", blurred, 12)
    warnings = capture_video(tmp_path / "a.mp4", tmp_path / "out", 8).warnings
    assert any("blurred throughout" in warning for warning in warnings)


def test_what_is_no_video_is_refused(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"none")
    with pytest.raises(InputError, match=r"a\.mp4.*video"):
        capture_video(tmp_path / "a.mp4", tmp_path / "out", 8)


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
    for frame in video_frames(tmp_path / "a.mp4"):
        assert frame.shape == upright.shape
        assert np.abs(frame.astype(int) - upright).mean() < 8
