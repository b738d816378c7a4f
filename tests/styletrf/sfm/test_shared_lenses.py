"""Rooms photographed with two lenses of one size, of which no EXIF says anything."""

from dataclasses import replace

import pycolmap
import pytest
from made_photographs import encoded, room_poses, room_view, with_exif
from message_words import mentions

from styletrf.capture.capture_file import write_capture
from styletrf.capture.scene_capture import capture_photographs
from styletrf.geometry.camera_table import read_cameras
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses

CONFIG = CameraPosesConfig(max_features=1024)


def lens_of(focal_px, scale):
    """Returns a lens for pictures of 240x180 and their focal length, times a scale."""
    params = [scale * focal_px, scale * 120.0, scale * 90.0, -0.04]
    size = {"width": 240 * scale, "height": 180 * scale}
    return pycolmap.Camera(model="SIMPLE_RADIAL", params=params, **size)


def photographed(folder, lenses, focals_35mm=None):
    """Writes a photograph with each lens along an arc, and returns the capture of them.

    With `focals_35mm`, 0 for unknown, they are JPEGs whose EXIF has it.
    """
    (folder / "in").mkdir()
    (folder / "out").mkdir()
    for k, (pose, lens) in enumerate(zip(room_poses(len(lenses)), lenses, strict=True)):
        view = room_view(pose, lens)
        if focals_35mm is None:
            (folder / "in" / f"{k:02d}.png").write_bytes(encoded(view, ".png"))
        else:
            jpeg = with_exif(encoded(view), focal_35mm=focals_35mm[k])
            (folder / "in" / f"{k:02d}.jpg").write_bytes(jpeg)
    return capture_photographs(folder / "in", folder / "capture")


def focals_of(folder):
    return [camera.fx for camera in read_cameras(folder / "out" / "cameras.parquet")]


def test_two_clips_of_one_size_have_two_focal_lengths(tmp_path):
    """Clips filmed at 1x and 2x had one: their poses were bent, or one of them was lost."""
    focals_px = [225.0] * 4 + [400.0] * 4
    capture = photographed(tmp_path, [lens_of(focal_px, 1) for focal_px in focals_px])
    frames = [
        replace(one, clip="ab"[k // 4] + ".mp4", time_s=k / 2)
        for k, one in enumerate(capture.photographs)
    ]
    write_capture(tmp_path / "capture", replace(capture, photographs=tuple(frames)))
    report = solve_camera_poses(tmp_path / "capture", tmp_path / "out", CONFIG)
    assert (report.registered, report.lens_settings) == (8, 2)
    assert focals_of(tmp_path) == pytest.approx(focals_px, rel=0.05)


@pytest.mark.parametrize(("scale", "rel"), [(3, 0.02), (1, 0.05)])
def test_photographs_of_two_cameras_without_exif_get_a_lens_each(tmp_path, scale, rel):
    """Tourists' photographs from the web: one lens for all bends the poses.

    Small ones agree with bent poses to within the pixels that a mapper accepts.
    """
    focals_px = [225.0, 400.0] * 3
    photographed(tmp_path, [lens_of(focal_px, scale) for focal_px in focals_px])
    report = solve_camera_poses(tmp_path / "capture", tmp_path / "out", CONFIG)
    assert mentions(report.mapper_reason, "6 of 6")
    assert report.lens_settings == len(report.lenses) == 6
    assert focals_of(tmp_path) == pytest.approx([scale * f for f in focals_px], rel=rel)


def test_photographs_without_exif_get_their_own_lens_where_it_is_not_that_of_those_with_it(
    tmp_path,
):
    """They had the lens of those with EXIF, whatever the photographs showed."""
    focals_px = [33 / 35 * 240] * 5 + [400.0] * 3
    photographed(tmp_path, [lens_of(focal_px, 1) for focal_px in focals_px], [33] * 5 + [0] * 3)
    report = solve_camera_poses(tmp_path / "capture", tmp_path / "out", CONFIG)
    assert (report.registered, report.lens_settings) == (8, 4)
    assert [found.photographs for found in report.lenses] == [5, 1, 1, 1]
    assert focals_of(tmp_path) == pytest.approx(focals_px, rel=0.05)
