"""The embedded scene: exact geometry, Lambertian but for the vase, made whole or not at all."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from message_words import mentions
from surface_points import surface_points

from styletrf.errors import InputError
from styletrf.geometry.camera_table import read_cameras
from styletrf.geometry.cameras import Camera, pixel_centers, project
from styletrf.synthetic.courtyard import (
    CourtyardConfig,
    courtyard_cameras,
    exact_flow,
    folder,
    render_view,
)
from styletrf.synthetic.courtyard.__main__ import main
from styletrf.synthetic.courtyard.capture import lit_scene
from styletrf.synthetic.courtyard.mesh import Mesh, lathe, panel
from styletrf.synthetic.courtyard.rays import build_hierarchy, first_hit, new_stack
from styletrf.synthetic.courtyard.render import render_linear
from styletrf.synthetic.courtyard.scene import courtyard_parts

SMALL = CourtyardConfig(n_views=12, width=80, height=60)


@pytest.fixture(scope="module")
def cameras():
    return courtyard_cameras(SMALL)


@pytest.fixture(scope="module")
def depths(cameras):
    return [render_view(camera, SMALL)[1] for camera in cameras[:2]]


def narrow(camera, point, focal=1e5):
    """A camera at the same place whose one tiny pixel is centered on a world point."""
    plain = replace(camera, width=1, height=1, fx=focal, fy=focal, cx=0.0, cy=0.0)
    pixel, _ = project(plain, point[None])
    return replace(plain, cx=0.5 - float(pixel[0, 0]), cy=0.5 - float(pixel[0, 1]))


def seen_at(camera, points):
    """Linear light and depth at world points, and whether each point is the first thing seen."""
    scene = lit_scene(SMALL)
    views = [render_linear(scene, narrow(camera, point)) for point in points]
    light = np.array([view[0][0, 0] for view in views])
    depth = np.array([view[1][0, 0] for view in views])
    return light, depth, project(camera, points)[1]


def on_vase(points):
    return (np.hypot(points[:, 0], points[:, 1]) < 0.3) & (points[:, 2] > 0.97)


def test_traversal_agrees_with_every_triangle_in_turn():
    rng = np.random.default_rng(0)
    corners = rng.uniform(-1, 1, (300, 1, 3)) + 0.2 * rng.normal(size=(300, 3, 3))
    tree, order = build_hierarchy(corners.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    stack, hits = new_stack(), 0
    for origin, direction in zip(
        rng.uniform(-2, 2, (200, 3)), rng.normal(size=(200, 3)), strict=True
    ):
        columns = np.stack(
            [corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0],
             np.broadcast_to(-direction, (300, 3))], axis=-1
        )  # fmt: skip
        u, v, t = np.linalg.solve(columns, (origin - corners[:, 0])[..., None])[..., 0].T
        met = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
        found, index, _, _ = first_hit(tree, stack, *origin, *direction, any_hit=False)
        assert found == pytest.approx(met.min(), rel=1e-9)
        assert (index < 0) == np.isinf(met.min())
        assert (first_hit(tree, stack, *origin, *direction, any_hit=True)[1] < 0) == (index < 0)
        if index >= 0:
            assert order[index] == met.argmin()
            hits += 1
    assert 20 < hits < 180


def outward(mesh: Mesh) -> np.ndarray:
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def test_solids_wind_and_shade_outwards():
    floor = panel((0, 0, 0), (2, 0, 0), (0, -3, 0))
    assert (outward(floor) @ [0, 0, 1] > 0).all()
    np.testing.assert_allclose(floor.normals, [[0, 0, 1]] * 4, atol=1e-12)
    cylinder = lathe((1, 2, 0), np.array([[0.5, 1.0], [0.5, 0.5], [0.5, 0.0]]))
    radial = cylinder.vertices - [1, 2, 0]
    np.testing.assert_allclose(cylinder.normals[:, :2], radial[:, :2] / 0.5, atol=1e-12)


def test_depth_of_one_view_is_where_another_sees_or_hides_it(cameras, depths):
    points = surface_points(cameras[0], depths[0])[::15]
    _, found, expected = seen_at(cameras[1], points)
    assert (found <= expected * (1 + 1e-5)).all()
    assert np.mean(found > expected * (1 - 1e-5)) > 0.8


def test_flow_is_visible_exactly_where_a_ray_from_the_other_camera_arrives(cameras, depths):
    flow, visible = exact_flow(cameras[0], depths[0], cameras[1], depths[1])
    points = surface_points(cameras[0], depths[0])
    targets, _ = project(cameras[1], points)
    surface = np.isfinite(depths[0]).reshape(-1)
    moved = pixel_centers(80, 60) + flow.reshape(-1, 2)
    np.testing.assert_allclose(moved[surface], targets, atol=1e-4)
    chosen = visible.reshape(-1)[surface]
    _, found, expected = seen_at(cameras[1], points[chosen][::11])
    assert np.mean(np.abs(found / expected - 1) < 1e-5) > 0.97
    assert chosen.mean() > 0.6
    assert chosen.mean() < 0.99  # the views differ enough to hide something


def test_flow_between_the_same_camera_is_zero_and_all_visible(cameras, depths):
    flow, visible = exact_flow(cameras[0], depths[0], cameras[0], depths[0])
    np.testing.assert_allclose(flow, 0, atol=1e-9)
    assert visible.all()


def test_flow_of_a_pure_rotation_is_its_homography(cameras, depths):
    a = cameras[0]
    turn, _ = cv2.Rodrigues(np.array([0.03, -0.05, 0.1]))
    pose = np.column_stack([a.world_from_camera[:, :3] @ turn, a.center_world])
    b = replace(a, world_from_camera=pose)
    flow, visible = exact_flow(a, depths[0], b, render_view(b, SMALL)[1])
    intrinsics = np.array([[a.fx, 0, a.cx], [0, a.fy, a.cy], [0, 0, 1]])
    start = np.column_stack([pixel_centers(80, 60), np.ones(80 * 60)])
    end = start @ (intrinsics @ turn.T @ np.linalg.inv(intrinsics)).T
    expected = end[:, :2] / end[:, 2:] - start[:, :2]
    np.testing.assert_allclose(flow.reshape(-1, 2), expected, atol=1e-9)
    assert visible[np.isinf(depths[0])].mean() > 0.5  # the sky is seen again too


def test_only_the_vase_changes_color_with_the_view(cameras, depths):
    points = surface_points(cameras[0], depths[0])
    for points_of_kind, changes in ((points[on_vase(points)], True), (points[::9], False)):
        if not changes:
            points_of_kind = points_of_kind[~on_vase(points_of_kind)]
        light, *depth = zip(*(seen_at(c, points_of_kind) for c in cameras[:2]), strict=True)
        found, expected = (np.array(d) for d in depth)
        both = (np.abs(found / expected - 1) < 1e-5).all(axis=0)
        change = np.abs(light[0] - light[1]).max(axis=1)[both]
        assert both.sum() > 20
        if changes:
            assert np.mean(change > 5e-3) > 0.5
        else:
            assert np.mean(change < 5e-3) > 0.98


def test_a_pixel_is_the_light_of_its_area(cameras):
    scene = lit_scene(SMALL)
    camera = replace(cameras[0], width=40, height=30, fx=34.0, fy=34.0, cx=20.0, cy=15.0)
    factor = 8
    fine = replace(
        camera, width=320, height=240, fx=34.0 * factor, fy=34.0 * factor, cx=160.0, cy=120.0
    )
    area = render_linear(scene, fine)[0].reshape(30, factor, 40, factor, 3).mean(axis=(1, 3))
    error = render_linear(scene, camera)[0] - area
    assert abs(error.mean()) < 0.01
    assert np.sqrt((error**2).mean()) < 0.1 * area.mean() + 0.02


def test_the_sky_is_plain_and_at_infinity(cameras):
    image, depth = render_view(cameras[0], SMALL)
    sky = np.isinf(depth)
    assert 0.05 < sky.mean() < 0.4
    assert (depth[~sky] > 0).all()
    deep = cv2.erode(sky.astype(np.uint8), np.ones((3, 3))) > 0
    steps = np.abs(np.diff(image.astype(int), axis=1)).max(axis=-1)
    assert steps[deep[:, 1:] & deep[:, :-1]].max() <= 2


def test_a_photograph_has_features_for_structure_from_motion():
    config = CourtyardConfig()
    image, _ = render_view(courtyard_cameras(config)[3], config)
    keypoints = cv2.SIFT_create().detect(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)
    assert len(keypoints) > 800


def test_the_same_seed_makes_the_same_courtyard():
    first, again = (courtyard_parts(3, glossy=True) for _ in range(2))
    matte = courtyard_parts(4, glossy=False)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.mesh.vertices, b.mesh.vertices)
        np.testing.assert_array_equal(a.texture, b.texture)
    assert not np.array_equal(first[0].texture, matte[0].texture)
    assert [part.glossy for part in first].count(True) == 1
    assert not any(part.glossy for part in matte)


def test_forward_cameras_look_the_same_way_and_orbit_cameras_inwards():
    forward = courtyard_cameras(CourtyardConfig(kind="forward"))
    axes = np.stack([camera.forward_world for camera in forward])
    assert (axes @ axes.T > np.cos(np.radians(15))).all()
    orbit = courtyard_cameras(CourtyardConfig(kind="orbit"))
    centers = np.stack([camera.center_world for camera in orbit])
    toward = np.array([0, 0, 0.85]) - centers
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    looks = np.stack([camera.forward_world for camera in orbit])
    assert ((looks * toward).sum(axis=1) > 0.99).all()
    assert np.abs(centers[:, :2].mean(axis=0)).max() < 0.2
    for camera in forward + orbit:
        axes = camera.world_from_camera[:, :3]
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)


@pytest.mark.parametrize("wrong", [{"kind": "dive"}, {"n_views": 0}, {"width": 0}])
def test_a_capture_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(InputError):
        courtyard_cameras(replace(SMALL, **wrong))


def command(place: Path, *more: str) -> int:
    return main([str(place), "--views", "2", "--width", "32", "--height", "24", *more])


def snapshot(place: Path) -> dict[str, tuple[bytes, int]]:
    files = [path for path in sorted(place.rglob("*")) if path.is_file()]
    return {str(f.relative_to(place)): (f.read_bytes(), f.stat().st_mtime_ns) for f in files}


def test_the_command_writes_photographs_and_truth_once(tmp_path, capsys):
    assert command(tmp_path / "a") == 0
    first = snapshot(tmp_path / "a")
    assert sorted(first) == [
        "images/000.png", "images/001.png", "truth/cameras.parquet", "truth/capture.json",
        "truth/depth/000.npy", "truth/depth/001.npy",
    ]  # fmt: skip
    assert command(tmp_path / "a") == 0
    assert snapshot(tmp_path / "a") == first
    assert command(tmp_path / "b") == 0
    again = snapshot(tmp_path / "b")
    assert {k: v[0] for k, v in again.items()} == {k: v[0] for k, v in first.items()}
    camera = read_cameras(tmp_path / "a" / "truth" / "cameras.parquet")[0]
    assert isinstance(camera, Camera)
    image, depth = render_view(camera, SMALL)
    np.testing.assert_array_equal(np.load(tmp_path / "a" / "truth/depth/000.npy"), depth)
    saved = cv2.imread(str(tmp_path / "a" / "images/000.png"))
    np.testing.assert_array_equal(saved[..., ::-1], image)


def test_the_command_refuses_a_folder_with_other_images(tmp_path, capsys):
    assert command(tmp_path) == 0
    before = snapshot(tmp_path)
    assert command(tmp_path, "--seed", "9") == 2
    assert mentions(capsys.readouterr().err, tmp_path / "images")
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize("failing", ["write_cameras", "capture_courtyard"])
def test_an_interrupted_run_leaves_nothing_and_the_next_completes(tmp_path, monkeypatch, failing):
    def interrupted(*_arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(folder, failing, interrupted)
        with pytest.raises(KeyboardInterrupt):
            command(tmp_path)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "truth").mkdir()  # of a run killed between its last two moves
    assert command(tmp_path) == 0
    assert len(snapshot(tmp_path)) == 6
