import json
from contextlib import nullcontext
from dataclasses import replace

import cv2
import numpy as np
import pycolmap
import pytest
from expected_errors import rejects
from made_photographs import LENS, encoded, room_poses, room_view, texture, with_exif
from message_words import mentions
from similarities import similarity

from styletrf.capture.capture_file import Photograph
from styletrf.capture.masks import read_mask
from styletrf.capture.photographs import read_photograph
from styletrf.capture.scene_capture import capture_photographs
from styletrf.capture.views import load_views
from styletrf.geometry.camera_table import read_cameras, read_unregistered
from styletrf.geometry.cameras import project
from styletrf.geometry.point_table import read_points
from styletrf.sfm.camera_poses import CameraPosesConfig, solve_camera_poses
from styletrf.sfm.mapping import SfmResult, require_explained

VIEWS = 7
CONFIG = CameraPosesConfig(max_features=512)  # enough for photographs of 240x180


def captured(folder, photographs):
    (folder / "in").mkdir(parents=True)
    (folder / "out").mkdir()
    for name, image in photographs.items():
        (folder / "in" / name).write_bytes(encoded(image, ".png"))
    capture_photographs(folder / "in", folder / "capture")
    return folder / "capture", folder / "out"


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A room photographed from seven places, and once a picture that has nothing to do with it."""
    folder = tmp_path_factory.mktemp("room")
    photographs = {f"{i}.png": room_view(pose) for i, pose in enumerate(room_poses(VIEWS))}
    photographs["stray.png"] = texture(LENS.height, LENS.width, seed=99)
    capture, out = captured(folder, photographs)
    calls, scratch = [], folder / "scratch"
    scratch.mkdir()

    def progress(*call):
        calls.append(call)
        assert len(list(scratch.iterdir())) == 1

    report = solve_camera_poses(capture, out, CONFIG, progress, folder / "log", scratch)
    return out, report, calls


def test_poses_are_those_the_photographs_were_taken_from(solved):
    out, _, _ = solved
    found = np.array([camera.world_from_camera for camera in read_cameras(out / "cameras.parquet")])
    truth = room_poses(VIEWS)
    scale, rotation = similarity(found[:, :, 3], truth[:, :, 3])
    centers = scale * (found[:, :, 3] - found[:, :, 3].mean(axis=0)) @ rotation.T
    expected = truth[:, :, 3] - truth[:, :, 3].mean(axis=0)
    assert np.abs(centers - expected).max() < 0.01 * np.ptp(expected, axis=0).max()
    relative = np.einsum("ij,njk,nlk->nil", rotation, found[:, :, :3], truth[:, :, :3])
    angles = np.arccos(np.clip((np.trace(relative, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.degrees(angles).max() < 0.3


def test_the_lens_is_found_and_straightened(solved):
    out, report, _ = solved
    assert report.camera_params == pytest.approx(LENS.params, rel=0.02, abs=0.01)
    cameras = read_cameras(out / "cameras.parquet")
    assert len({(c.width, c.height, c.fx, c.fy, c.cx, c.cy) for c in cameras}) == 1
    for camera in cameras:
        image = read_photograph(out / "images" / f"{camera.name}.png")
        assert image.shape == (camera.height, camera.width, 3) == (LENS.height, LENS.width, 3)


def test_points_project_where_they_were_seen_with_their_colors(solved):
    out, report, _ = solved
    points = read_points(out / "points.parquet")
    assert len(points.xyz_world) == report.points > 100
    assert (points.track_length >= 2).all()
    for index, camera in enumerate(read_cameras(out / "cameras.parquet")):
        seen = points.observed_image == index
        pixels, depth = project(camera, points.xyz_world[points.observed_point[seen]])
        assert (depth > 0).all()
        error = np.linalg.norm(pixels - points.observed_pixel[seen], axis=1)
        assert np.median(error) < 0.5
        image = read_photograph(out / "images" / f"{camera.name}.png")
        inside = ((pixels > 0) & (pixels < [camera.width, camera.height])).all(axis=1)
        x, y = pixels[inside].astype(int).T
        colors = points.rgb[points.observed_point[seen][inside]]
        assert np.median(np.abs(image[y, x].astype(int) - colors)) < 16


def test_the_stray_picture_is_named(solved):
    out, report, _ = solved
    assert (report.registered, report.total, report.unregistered) == (VIEWS, VIEWS + 1, ("stray",))
    assert read_unregistered(out / "cameras.parquet") == ["stray"]
    assert [camera.name for camera in read_cameras(out / "cameras.parquet")] == list("0123456")
    (warning,) = report.warnings
    assert mentions(warning, "stray")
    assert {path.name for path in (out / "images").iterdir()} == {f"{i}.png" for i in range(VIEWS)}


def test_the_report_is_in_the_file_and_names_no_time(solved):
    out, report, _ = solved
    content = json.loads((out / "poses.json").read_text())
    assert content["registered"] == report.registered
    assert content["tells_depth"] == report.has_parallax  # the key of earlier versions
    assert content["mean_reprojection_error_px"] < 0.5
    assert not any("second" in key or "time" in key for key in content)


def test_colmap_works_in_the_scratch_folder_and_leaves_only_its_log(solved):
    folder = solved[0].parent
    assert not list((folder / "scratch").iterdir())
    assert any(path.name.startswith("colmap.") for path in (folder / "log").iterdir())


def test_progress_comes_in_phases_that_complete(solved):
    _, _, calls = solved
    assert {total for _, total in calls} == {VIEWS + 1, VIEWS * (VIEWS + 1) // 2, VIEWS}
    assert sum(done == total for done, total in calls) >= 5
    assert all(0 <= done <= total for done, total in calls)


@pytest.mark.parametrize("lenses", ["one", "each"])
def test_the_same_photographs_have_the_same_cameras_to_the_last_bit(tmp_path, lenses):
    """Whatever the threads that describe them: else all that is made of them would be new, too."""
    photographs = {f"{i}.png": room_view(pose) for i, pose in enumerate(room_poses(6))}
    capture, _ = captured(tmp_path, photographs)
    outputs = []
    for k in range(2):
        out = tmp_path / f"out{k}"
        out.mkdir()
        solve_camera_poses(capture, out, replace(CONFIG, lenses=lenses))
        outputs.append({p.name: p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file()})
    assert outputs[0] == outputs[1]


def test_photographs_without_overlap_are_refused(tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, (5, 60, 80, 3), dtype=np.uint8)
    capture, out = captured(tmp_path, {f"{i}.png": image for i, image in enumerate(noise)})
    with rejects("5 photographs", "none"):
        solve_camera_poses(capture, out, CameraPosesConfig(), log_dir=tmp_path / "log")
    assert not any(out.iterdir())


@pytest.mark.parametrize(("explained", "is_refused"), [(0.34, True), (0.82, False)])
def test_poses_that_explain_too_little_are_refused_unless_settings_say_otherwise(
    explained, is_refused
):
    """Of five photographs, four were placed 46 degrees off, and a fly-through of fog was made."""
    options = pycolmap.SyntheticDatasetOptions(num_rigs=1, num_cameras_per_rig=1)
    model = pycolmap.synthesize_dataset(options)
    mapping = SfmResult([model], "", 1, "", "", explained)
    photographs = [Photograph(str(k), "", 8, 8, 0, "") for k in range(9)]
    refusal = rejects("9 photographs", "34%", "50%", remedy=["least_explained"])
    with refusal if is_refused else nullcontext():
        require_explained(mapping, photographs, CameraPosesConfig().least_explained)
    require_explained(mapping, photographs, 0.0)


def test_photographs_of_nothing_are_refused(tmp_path):
    plain = {f"{i}.png": np.full((48, 64, 3), 90 + i, np.uint8) for i in range(3)}
    capture, out = captured(tmp_path, plain)
    with rejects("3 photographs", "none"):
        solve_camera_poses(capture, out, CameraPosesConfig(), log_dir=tmp_path / "log")


def test_photographs_of_two_zooms_get_two_lenses(tmp_path):
    """As their EXIF tells: one lens for both would bend the room."""
    zoomed = pycolmap.Camera(
        model="SIMPLE_RADIAL", width=240, height=180, params=[330.0, 120.0, 90.0, -0.02]
    )
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    for i, pose in enumerate(room_poses(10)):
        lens = zoomed if i % 3 == 1 else LENS
        focal_35mm = round(36 * lens.params[0] / 240)
        jpeg = encoded(room_view(pose, lens), ".jpg", cv2.IMWRITE_JPEG_QUALITY, 97)
        (tmp_path / "in" / f"{i}.jpg").write_bytes(with_exif(jpeg, 1, focal_35mm))
    capture_photographs(tmp_path / "in", tmp_path / "capture")
    report = solve_camera_poses(tmp_path / "capture", tmp_path / "out", CONFIG)
    assert (report.registered, report.lens_settings) == (10, 2)
    focals = [camera.fx for camera in read_cameras(tmp_path / "out" / "cameras.parquet")]
    for i, focal in enumerate(focals):
        assert focal == pytest.approx(330.0 if i % 3 == 1 else 225.0, rel=0.05)


def test_of_photographs_of_two_places_the_larger_set_is_used_and_the_others_named(tmp_path):
    poses = room_poses(5)
    photographs = {f"here{i}.png": room_view(pose) for i, pose in enumerate(poses)}
    photographs |= {f"there{i}.png": room_view(poses[i], seed=7) for i in range(3)}
    capture, out = captured(tmp_path, photographs)
    report = solve_camera_poses(capture, out, replace(CONFIG, max_features=256))
    assert report.registered == 5
    assert set(report.unregistered) == {f"there{i}" for i in range(3)}
    assert any(mentions(warning, *report.unregistered) for warning in report.warnings)


def test_photographs_that_lie_stand_and_are_reduced_are_placed_together(tmp_path):
    """Each keeps its shape; the lens of each size is found, without any word of it in the files."""
    standing = pycolmap.Camera(
        model="SIMPLE_RADIAL", width=180, height=240, params=[225.0, 90.0, 120.0, -0.06]
    )
    photographs = {}
    for i, pose in enumerate(room_poses(12)):
        image = room_view(pose, standing if i % 2 else LENS)
        photographs[f"{i}.png"] = cv2.resize(image, (192, 144)) if i % 4 == 2 else image
    capture, out = captured(tmp_path, photographs)
    report = solve_camera_poses(capture, out, CONFIG)
    assert (report.registered, report.lens_settings) == (12, 3)
    found = [(one.lens.width, one.lens.height, one.photographs) for one in report.lenses]
    assert found == [(180, 240, 6), (240, 180, 3), (192, 144, 3)]
    for i, camera in enumerate(read_cameras(out / "cameras.parquet")):
        height, width = photographs[f"{i}.png"].shape[:2]
        assert (camera.width, camera.height) == (width, height)
        assert camera.fx == pytest.approx(225.0 * (0.8 if i % 4 == 2 else 1.0), rel=0.08)


def test_nothing_is_sought_where_a_mask_is_black(tmp_path):
    """A window of foreign texture, at one place of all photographs, would pin them there."""
    (tmp_path / "in" / "masks").mkdir(parents=True)
    mask = np.full((LENS.height, LENS.width), 255, np.uint8)
    mask[40:140, 60:180] = 0
    photographs = {}
    for i, pose in enumerate(room_poses(VIEWS)):
        photographs[f"{i}.png"] = room_view(pose)
        photographs[f"{i}.png"][mask == 0] = texture(100, 120, seed=50).reshape(-1, 3)
        (tmp_path / "in" / "masks" / f"{i}.png").write_bytes(encoded(mask, ".png"))
    for name, image in photographs.items():
        (tmp_path / "in" / name).write_bytes(encoded(image, ".png"))
    capture_photographs(tmp_path / "in", tmp_path / "capture")
    out = tmp_path / "out"
    out.mkdir()
    report = solve_camera_poses(tmp_path / "capture", out, CONFIG)
    assert report.registered == VIEWS
    points, cameras = read_points(out / "points.parquet"), read_cameras(out / "cameras.parquet")
    for index, camera in enumerate(cameras):
        counts = read_mask(out / "masks" / f"{camera.name}.png")
        assert 0.6 < counts.mean() < 0.85
        x, y = points.observed_pixel[points.observed_image == index].astype(int).T
        assert counts[y.clip(0, LENS.height - 1), x.clip(0, LENS.width - 1)].mean() > 0.98
    views = load_views(out / "images", cameras)
    assert all(view.shape == (LENS.height, LENS.width, 4) for view in views)


def test_photographs_from_one_spot_are_warned_of(tmp_path, solved):
    """A camera that only turns sees no depth."""
    pose = room_poses(1)[0]
    photographs = {}
    for k, angle in enumerate(0.06 * np.arange(-2, 3)):
        turn = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        turned = np.column_stack([np.array(turn) @ pose[:, :3], pose[:, 3]])
        photographs[f"{k}.png"] = room_view(turned)
    capture, out = captured(tmp_path, photographs)
    report = solve_camera_poses(capture, out, CameraPosesConfig())
    assert report.doubts
    assert not solved[1].doubts
    assert (report.has_parallax, solved[1].has_parallax) == (False, True)


@pytest.mark.parametrize(("look_down", "has_parallax"), [(0.0, False), (1.6, True)])
def test_a_facade_with_parallax_has_it_and_a_flat_wall_has_none(tmp_path, look_down, has_parallax):
    """Seen from several places; before the facade is some ground, and every pair is flat."""
    photographs = {}
    for k, y in enumerate(np.linspace(3.0, 5.0, 7)):
        center = np.array([3.0, y, 2.5])
        forward = np.array([-3.0, 0.0, -look_down])
        forward /= np.linalg.norm(forward)
        pose = np.column_stack([[0, 1, 0], np.cross(forward, [0, 1, 0]), forward, center])
        photographs[f"{k}.png"] = room_view(pose)
    capture, out = captured(tmp_path, photographs)
    report = solve_camera_poses(capture, out, CONFIG)
    assert (report.flat_pairs, report.has_parallax) == (1.0, has_parallax)
    assert bool(report.doubts) != has_parallax
