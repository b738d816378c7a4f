"""Exports of small fields in all three spaces: files are in COLMAP's world, whatever the space."""

import json
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from ball_views import RADIUS, ball_seen
from ball_views import camera as camera_around
from expected_errors import rejects
from message_words import mentions
from tiny_scene import KINDS, tiny_scene

from styletrf.exports import splat_export
from styletrf.exports.export_views import ExportViews, Look, export_views, offset_world
from styletrf.exports.splat_export import HeldOut, export_splats
from styletrf.exports.splat_files import read_splats
from styletrf.exports.splat_pictures import splat_picture
from styletrf.exports.splats import Splats, tensors_of
from styletrf.exports.surface_export import export_mesh, export_points
from styletrf.exports.surface_mesh import surface_mesh
from styletrf.geometry.cameras import Camera, in_view, moved
from styletrf.progress import silent

CPU = torch.device("cpu")
spaces = pytest.mark.parametrize("space", list(KINDS))


@cache
def views_of(space: str) -> ExportViews:
    scene = tiny_scene(space)
    return export_views(
        scene.model, scene.fields["Photographs"], scene.cameras, scene.cameras[:2], CPU
    )


def looks_of(space: str) -> list[Look]:
    fields = tiny_scene(space).fields
    names = {"photographs": fields["Photographs"], "style": fields["style 1"]}
    return [(name, lambda field=field: field) for name, field in names.items()]


def in_world(space: str, camera: Camera) -> Camera:
    return moved(camera, np.linalg.inv(tiny_scene(space).model.normalized_from_world))


def photographed(color: torch.Tensor) -> torch.Tensor:
    return (color * 255).round().byte()


@spaces
def test_splats_show_what_the_field_shows_and_share_their_geometry(space: str, tmp_path: Path):
    pytest.importorskip("gsply", reason="gsply is not installed (extra export)")
    views = views_of(space)
    held_out = HeldOut(views.cameras[:1], [photographed(views.renders[0].color)])
    done = []
    report = export_splats(
        tmp_path, "spz", views, looks_of(space), held_out, 6000, lambda *work: done.append(work)
    )
    n_views = len(views.cameras)
    assert done[:n_views] == [(k + 1, n_views) for k in range(n_views)]
    assert 0 < report["splats"] <= 6000
    geometry = []
    for k, (name, _) in enumerate(looks_of(space)):
        splats, colors = read_splats(tmp_path / f"{name}.spz")
        geometry.append(np.column_stack([splats.centers, splats.scales, splats.rotations]))
        assert len(splats) == report["splats"]
        found = report["looks"][name]
        assert found["bytes"] == (tmp_path / f"{name}.spz").stat().st_size
        camera = in_world(space, views.cameras[0])
        background, bank = torch.tensor(found["background"]), torch.from_numpy(colors)
        picture = splat_picture(tensors_of(splats), bank, camera, background)
        exact = next(views.pictures(looks_of(space)[k][1]()))
        error = np.square(picture.clamp(0, 1).numpy() - exact).mean()
        assert -10 * np.log10(error) == pytest.approx(found["psnr_to_field"], abs=0.1)
        assert found["psnr_to_field"] > 30
    assert np.array_equal(*geometry)


@pytest.mark.parametrize("space", ["ndc", "box"])
def test_points_and_meshes_lie_where_a_view_saw_them(space: str, tmp_path: Path):
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed (extra export)")
    pytest.importorskip("skimage", reason="scikit-image is not installed (extra export)")
    views = replace(
        views_of(space), cameras=views_of(space).cameras[:1], renders=views_of(space).renders[:1]
    )
    report = export_points(tmp_path, views, looks_of(space), silent)
    report |= export_mesh(tmp_path, views, looks_of(space), silent)
    assert 0 <= report["surface_share"] <= 1
    points = np.asarray(trimesh.load(tmp_path / "photographs.ply").vertices)
    (mesh,) = trimesh.load(tmp_path / "photographs.glb", process=False).geometry.values()
    for found, fraction in ((points, 0.8), (np.asarray(mesh.vertices) * (1, -1, -1), 0.5)):
        (camera,), (render,) = views.cameras, views.renders
        pixels, depth, inside = in_view(in_world(space, camera), found)
        column, row = pixels[inside].astype(int).T
        scale = np.cbrt(np.linalg.det(views.model.normalized_from_world[:3, :3]))
        seen, own = render.median_depth.numpy()[row, column], depth[inside] * scale
        assert (np.abs(own - seen) < 0.1 * own).mean() > fraction
    assert json.dumps(report)


def test_points_and_splats_of_georeferenced_poses_keep_their_precision(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """They were rounded to half a meter, or all lay at the end of the range."""
    pytest.importorskip("gsply", reason="gsply is not installed (extra export)")
    plyfile = pytest.importorskip("plyfile", reason="plyfile is not installed")
    monkeypatch.setattr(
        splat_export, "SplatFitConfig", partial(splat_export.SplatFitConfig, iterations=1)
    )
    local = views_of("box")
    away = np.eye(4)
    away[:3, 3] = (452000.25, -5411000.5, 300.0)
    moved_away = local.model.normalized_from_world @ np.linalg.inv(away)
    views = replace(local, model=replace(local.model, normalized_from_world=moved_away))
    assert not offset_world(local.model).any()
    offset = offset_world(views.model)

    def stored(given: ExportViews, folder: str) -> tuple[np.ndarray, np.ndarray]:
        out, looks = tmp_path / folder, looks_of("box")[:1]
        out.mkdir()
        held_out = HeldOut(views.cameras[:1], [photographed(views.renders[0].color)])
        report = export_splats(out, "spz", given, looks, held_out, 300, silent)
        assert report["looks"]["photographs"]["psnr_to_field"] > 15
        splats = read_splats(out / "photographs.spz")[0].centers
        export_points(out, given, looks, silent)
        vertices = plyfile.PlyData.read(out / "photographs.ply")["vertex"]
        return splats, np.column_stack([vertices[name] for name in "xyz"]).astype(np.float64)

    unit = 1 / np.cbrt(np.linalg.det(local.model.normalized_from_world[:3, :3]))
    pairs = zip(stored(views, "away"), stored(local, "local"), strict=True)
    for found, expected in pairs:
        assert np.abs(found + offset - away[:3, 3] - expected).max() < 1e-5 * unit


def test_an_export_notes_where_pictures_have_no_definite_surface(tmp_path: Path):
    pytest.importorskip("trimesh", reason="trimesh is not installed (extra export)")
    views, reports = views_of("box"), []
    for mean_of_median in (1.0, 1.2):  # a mean far behind the median is that of mist
        renders = [
            replace(r, median_depth=r.depth, depth=mean_of_median * r.depth) for r in views.renders
        ]
        given = replace(views, renders=renders)
        reports.append(export_points(tmp_path, given, looks_of("box"), silent))
    definite, mist = reports
    assert definite["surface_share"] > 0.5
    assert mist["surface_share"] == 0
    assert mist["note"] != definite["note"]


def test_what_masks_leave_out_of_photographs_does_not_count_against_splats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A passer-by who is masked was measured."""
    pytest.importorskip("gsply", reason="gsply is not installed (extra export)")
    brief = partial(splat_export.SplatFitConfig, iterations=10)
    monkeypatch.setattr(splat_export, "SplatFitConfig", brief)
    views = views_of("box")
    photograph = photographed(views.renders[0].color)
    counts = torch.full((*photograph.shape[:2], 1), 255, dtype=torch.uint8)
    counts[:, : photograph.shape[1] // 2] = 0
    spoiled = photograph.clone()
    spoiled[:, : photograph.shape[1] // 2] ^= 255
    found = []
    for shown in (photograph, spoiled):
        held_out = HeldOut(views.cameras[:1], [torch.cat([shown, counts], dim=2)])
        looks = looks_of("box")[:1]
        report = export_splats(tmp_path, "spz", views, looks, held_out, 500, silent)
        found.append(report["looks"]["photographs"])
    assert found[0] == found[1]
    assert found[0]["field_psnr"] > 40


def test_splats_beyond_the_range_of_spz_are_refused_before_they_are_fitted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    pytest.importorskip("gsply", reason="gsply is not installed (extra export)")
    monkeypatch.setattr(splat_export, "fitted_splats", pytest.fail)
    views = views_of("box")
    tiny_unit = np.diag([1e-8, 1e-8, 1e-8, 1.0]) @ views.model.normalized_from_world
    views = replace(views, model=replace(views.model, normalized_from_world=tiny_unit))
    with rejects("splats", remedy=["ply"]):
        export_splats(tmp_path, "spz", views, looks_of("box"), HeldOut([], []), 500, silent)


def test_a_single_splat_beyond_the_range_of_spz_is_left_out_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    pytest.importorskip("gsply", reason="gsply is not installed (extra export)")
    brief = partial(splat_export.SplatFitConfig, iterations=1)
    monkeypatch.setattr(splat_export, "SplatFitConfig", brief)
    placed = splat_export.placed_splats

    def with_one_far(*given: Any) -> Splats:
        splats = placed(*given)
        splats.centers[0] *= 1e9
        return splats

    monkeypatch.setattr(splat_export, "placed_splats", with_one_far)
    views, looks = views_of("box"), looks_of("box")[:1]
    held_out = HeldOut(views.cameras[:1], [photographed(views.renders[0].color)])
    report = export_splats(tmp_path, "spz", views, looks, held_out, 6000, silent)
    assert report["splats"] == len(read_splats(tmp_path / "photographs.spz")[0]) > 1000
    assert mentions(report["note"], 1, report["splats"] + 1, ".spz")


def test_a_field_that_stops_no_ray_has_nothing_to_export(tmp_path: Path):
    """Points of it ended in a traceback."""
    views = views_of("box")
    empty = [replace(r, median_depth=torch.full_like(r.depth, torch.inf)) for r in views.renders]
    nothing = replace(views, renders=empty)
    held_out = HeldOut([], [])
    with rejects("field", "ray"):
        export_points(tmp_path, nothing, looks_of("box"), silent)
    with rejects("field", "ray"):
        export_splats(tmp_path, "ply", nothing, looks_of("box"), held_out, 500, silent)


def test_in_unbounded_space_a_ball_is_a_ball():
    pytest.importorskip("skimage", reason="scikit-image is not installed (extra export)")
    views = [camera_around(angle) for angle in np.linspace(0, 2 * np.pi, 9)[:-1]]
    renders = [ball_seen(view) for view in views]
    mesh = surface_mesh(views, renders, tiny_scene("unbounded").model.space.to_world, (64, 64, 64))
    around = np.abs(mesh.vertices[:, 1]) < 0.3
    radius = np.linalg.norm(mesh.vertices[around], axis=1)
    assert np.abs(radius - RADIUS).max() < 0.1
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * corners.mean(axis=1)).sum(axis=1) > 0).mean() > 0.95
