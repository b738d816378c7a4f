import hashlib

import numpy as np
import pytest
from expected_errors import rejects
from made_panoramas import courtyard_panoramas, with_spherical_metadata
from made_photographs import encoded, texture
from message_words import mentions

from styletrf.capture.capture_file import read_capture
from styletrf.capture.clips.video_capture import capture_videos
from styletrf.capture.mask_files import find_clip_masks
from styletrf.capture.masks import read_mask
from styletrf.capture.panorama.panorama_views import (
    DIRECTIONS,
    cut_views,
    panorama_pixels,
    view_camera,
)
from styletrf.capture.photographs import read_photograph
from styletrf.capture.poses.given_poses import GivenPoses, GivenView, Lens
from styletrf.capture.scene_capture import capture_photographs
from styletrf.errors import InputError
from styletrf.files.video import write_video

WIDTH = 512


@pytest.fixture
def folder(tmp_path):
    """Three panoramas in a folder."""
    folder = tmp_path / "scene" / "images"
    folder.mkdir(parents=True)
    for index, image in enumerate(courtyard_panoramas(4, WIDTH)[1][:3]):
        (folder / f"p{index}.png").write_bytes(encoded(image, ".png"))
    return folder


def test_panoramas_become_views_named_by_them_and_a_direction(folder, tmp_path):
    capture = capture_photographs(folder, tmp_path / "out")
    assert capture == read_capture(tmp_path / "out")
    assert [(one.panorama, one.direction) for one in capture.photographs] == [
        (f"p{index}", direction) for index in range(3) for direction in DIRECTIONS
    ]
    panorama = read_photograph(folder / "p1.png")
    for one, (direction, view) in zip(capture.photographs[5:10], cut_views(panorama), strict=True):
        file = tmp_path / "out/images" / one.file
        assert one.name == f"p1_{direction}"
        assert (one.height, one.width) == view.shape[:2]
        assert np.array_equal(read_photograph(file), view)
        assert hashlib.sha256(file.read_bytes()).hexdigest() == one.sha256
    assert any(mentions(warning, "3 of 3") for warning in capture.warnings)


def test_a_photograph_with_the_name_of_a_view_of_a_panorama_is_refused(folder, tmp_path):
    """One of the two overwrote the other."""
    (folder / "P1_front.png").write_bytes(encoded(texture(48, 64), ".png"))
    with pytest.raises(InputError) as refusal:
        capture_photographs(folder, tmp_path / "out")
    assert refusal.value.subject == "P1_front.png"
    assert "p1.png" in refusal.value.problem
    assert not (tmp_path / "out").exists()
    capture = capture_photographs(folder, tmp_path / "out", panoramas="no")
    assert len(capture.photographs) == 4


def test_photographs_among_panoramas_stay_photographs(folder, tmp_path):
    (folder / "view.png").write_bytes(encoded(texture(48, 64), ".png"))
    capture = capture_photographs(folder, tmp_path / "out")
    (plain,) = (one for one in capture.photographs if one.panorama is None)
    assert (plain.name, plain.direction, len(capture.photographs)) == ("view", None, 16)


def test_panoramas_may_be_taken_as_they_are(folder, tmp_path):
    capture = capture_photographs(folder, tmp_path / "out", panoramas="no")
    assert [one.name for one in capture.photographs] == ["p0", "p1", "p2"]


def test_damaged_and_unwanted_panoramas_are_left_out_whole(folder, tmp_path):
    for index, image in enumerate(courtyard_panoramas(4, WIDTH)[1][:3]):
        (folder / f"q{index}.png").write_bytes(encoded(image[:, ::-1], ".png"))
    (folder / "p2.png").write_bytes(b"no image")
    capture = capture_photographs(folder, tmp_path / "out", leave_out=["q1"])
    assert {one.panorama for one in capture.photographs} == {"p0", "p1", "q0", "q2"}


def test_a_mask_is_cut_as_its_panorama(folder, tmp_path):
    """The mask covers the right half of the sphere, and with it all of the view to the right."""
    mask = np.full((WIDTH // 2, WIDTH, 3), 255, np.uint8)
    mask[:, WIDTH // 2 :] = 0
    (folder.parent / "masks").mkdir()
    (folder.parent / "masks" / "p0.png").write_bytes(encoded(mask, ".png"))
    capture = capture_photographs(folder, tmp_path / "out")
    names = {one.name for one in capture.photographs}
    assert "p1_right" in names
    assert "p0_right" not in names
    assert {path.stem for path in (tmp_path / "out/masks").iterdir()} == {
        f"p0_{direction}" for direction in ("front", "back", "left", "up")
    }
    counts = read_mask(tmp_path / "out/masks/p0_front.png")
    camera = view_camera("front", WIDTH)
    assert counts.shape == (camera.height, camera.width)
    assert counts[:, : camera.width // 2 - 2].all()
    assert not counts[:, camera.width // 2 + 2 :].any()


def test_a_view_of_a_panorama_is_left_out_by_a_colored_mask_as_by_a_black_one(folder, tmp_path):
    """It was kept where any channel was bright, and no pixel of it counted."""
    mask = np.full((WIDTH // 2, WIDTH, 3), 255, np.uint8)
    mask[:, WIDTH // 2 :] = (255, 0, 0)
    (folder.parent / "masks").mkdir()
    (folder.parent / "masks" / "p0.png").write_bytes(encoded(mask, ".png"))
    names = {one.name for one in capture_photographs(folder, tmp_path / "out").photographs}
    assert "p1_right" in names
    assert "p0_right" not in names


def test_a_mask_is_looked_up_where_the_pixel_is():
    left = np.array([[-1.0, 0.0, 0.0]])
    assert panorama_pixels(left, WIDTH, WIDTH // 2)[0] == pytest.approx([WIDTH / 4, WIDTH / 4])


def test_poses_that_came_with_photographs_name_their_lenses(folder, tmp_path):
    lens = Lens("SIMPLE_PINHOLE", (100.0, 128.0, 64.0), WIDTH, WIDTH // 2)
    views = tuple(GivenView(file, lens, np.eye(3, 4)) for file in sorted(folder.iterdir()))
    given = GivenPoses(folder, views)
    capture = capture_photographs(folder, tmp_path / "out", given=given)
    assert [one.panorama for one in capture.photographs] == [None] * 3
    with rejects(folder, "lenses"):
        capture_photographs(folder, tmp_path / "again", given=given, panoramas="yes")
    assert not (tmp_path / "again").exists()


def filmed(count):
    """What a camera for all directions sees that turns while it goes: frames of a clip."""
    start, end = (image.astype(float) for image in courtyard_panoramas(4, WIDTH)[1][:2])
    fractions = np.linspace(0, 1, count)
    mixed = [
        np.rint((1 - fraction) * start + fraction * end).astype(np.uint8) for fraction in fractions
    ]
    return [np.roll(image, -4 * k, axis=1) for k, image in enumerate(mixed)]


@pytest.mark.parametrize("said", [True, False])
def test_frames_of_a_panoramic_clip_are_cut(said, tmp_path):
    wall = texture(256, WIDTH + 200, 1)
    frames = [wall[:, 4 * k :] for k in range(24)] if said else filmed(24)
    write_video(tmp_path / "walk.mp4", [frame[:, :WIDTH] for frame in frames], 12)
    if said:
        clip = tmp_path / "walk.mp4"
        clip.write_bytes(with_spherical_metadata(clip.read_bytes()))
    capture = capture_videos([tmp_path / "walk.mp4"], tmp_path / "out", 20)
    assert capture == read_capture(tmp_path / "out")
    assert len(capture.photographs) == 20
    assert {one.panorama for one in capture.photographs} == {"0001", "0002", "0003", "0004"}
    for one in capture.photographs:
        assert (one.clip, one.name) == ("walk.mp4", f"{one.panorama}_{one.direction}")
        assert (tmp_path / "out/images" / one.file).is_file()
    assert any(mentions(warning, "walk.mp4", len(DIRECTIONS)) for warning in capture.warnings)


def test_a_frame_that_is_a_panorama_is_left_out_whole(tmp_path):
    write_video(tmp_path / "walk.mp4", filmed(24), 12)
    capture = capture_videos([tmp_path / "walk.mp4"], tmp_path / "out", 20, leave_out=["0002"])
    assert {one.panorama for one in capture.photographs} == {"0001", "0003", "0004"}


def test_the_mask_of_a_clip_of_panoramas_is_cut_as_its_frames(tmp_path):
    """The mask covers the right half of the sphere, and with it all of the views to the right."""
    wall = texture(WIDTH // 2, WIDTH + 60, 1)
    write_video(tmp_path / "walk.mp4", [wall[:, 5 * k : 5 * k + WIDTH] for k in range(12)], 12)
    mask = np.full((WIDTH // 2, WIDTH, 3), 255, np.uint8)
    mask[:, WIDTH // 2 :] = 0
    (tmp_path / "masks").mkdir()
    write_video(tmp_path / "masks/walk.mp4", [mask] * 12, 12)
    masks, clips = find_clip_masks(tmp_path, [tmp_path / "walk.mp4"]), [tmp_path / "walk.mp4"]
    capture = capture_videos(clips, tmp_path / "out", 15, panoramas="yes", masks=masks)
    assert {one.direction for one in capture.photographs} == {*DIRECTIONS} - {"right"}
    for one in capture.photographs:
        counts = read_mask(tmp_path / f"out/masks/{one.name}.png")
        assert counts.shape == (one.height, one.width)
        assert counts.all() == (one.direction == "left")
    assert not any(mentions(warning, "0001") for warning in capture.warnings)


def test_a_clip_beside_one_of_panoramas_gives_its_frames(tmp_path):
    """It gave a fifth of them, as if each were cut, too."""
    wall = texture(256, WIDTH + 200, 1)
    write_video(tmp_path / "flat.mp4", [wall[:120, 4 * k : 4 * k + 160] for k in range(40)], 12)
    write_video(tmp_path / "round.mp4", filmed(12), 12)
    clips = [tmp_path / "flat.mp4", tmp_path / "round.mp4"]
    capture = capture_videos(clips, tmp_path / "out", 30)
    photographs = sum(one.panorama is None for one in capture.photographs)
    panoramas = len({one.panorama for one in capture.photographs} - {None})
    assert len(capture.photographs) == photographs + 5 * panoramas
    assert photographs + panoramas > 30 // 5
    assert 30 - 5 < len(capture.photographs) <= 30


def test_a_clip_is_filmed_as_the_setting_says(tmp_path):
    write_video(tmp_path / "walk.mp4", filmed(24), 12)
    capture = capture_videos([tmp_path / "walk.mp4"], tmp_path / "a", 6, panoramas="no")
    assert [one.panorama for one in capture.photographs] == [None] * 6
    write_video(tmp_path / "flat.mp4", [frame[:100] for frame in filmed(24)], 12)
    with rejects("flat.mp4", "512x100"):
        capture_videos([tmp_path / "flat.mp4"], tmp_path / "b", 20, panoramas="yes")
