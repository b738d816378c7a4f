"""Meshes and points of what cameras see."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from ball_views import RADIUS, ball_seen, camera
from expected_errors import rejects

from styletrf.errors import InputError
from styletrf.exports.surface_files import write_glb, write_points
from styletrf.exports.surface_mesh import (
    SurfaceMesh,
    lattice_within,
    surface_fraction,
    surface_mesh,
    vertex_colors,
)
from styletrf.field.rendering import Rendering
from styletrf.geometry.cameras import Camera


def ball() -> tuple[list[Camera], list[Rendering], SurfaceMesh]:
    pytest.importorskip("skimage", reason="scikit-image is not installed (extra export)")
    views = [camera(angle) for angle in np.linspace(0, 2 * np.pi, 9)[:-1]]
    renders = [ball_seen(view) for view in views]
    return views, renders, surface_mesh(views, renders, lambda grid: grid, (48, 48, 48))


def test_the_mesh_of_a_ball_lies_on_it_and_looks_outward():
    _, _, mesh = ball()
    radius = np.linalg.norm(mesh.vertices, axis=1)
    around = np.abs(mesh.vertices[:, 1]) < 0.3  # the circle's cameras see no pole squarely
    assert np.abs(radius[around] - RADIUS).max() < 2 / 48
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = (normals * corners.mean(axis=1)).sum(axis=1) > 0
    assert outward.mean() > 0.99


def test_a_mesh_looks_outward_also_where_the_grid_is_mirrored():
    pytest.importorskip("skimage", reason="scikit-image is not installed (extra export)")
    views = [camera(angle) for angle in np.linspace(0, 2 * np.pi, 9)[:-1]]
    renders = [ball_seen(view) for view in views]
    mesh = surface_mesh(views, renders, lambda grid: grid * (1, 1, -1), (32, 32, 32))
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * corners.mean(axis=1)).sum(axis=1) > 0).mean() > 0.99


def test_vertices_have_the_colors_that_views_see():
    views, renders, mesh = ball()
    depths = [render.median_depth.numpy() for render in renders]
    colors = vertex_colors(mesh, views, depths, [render.color.numpy() for render in renders])
    side = np.abs(mesh.vertices[:, 0]) > 0.2
    around = side & (np.abs(mesh.vertices[:, 1]) < 0.3)
    expected = (mesh.vertices[around, 0] > 0).astype(float)
    assert np.abs(colors[around, 0] - expected).mean() < 0.05


def test_where_nothing_is_hit_there_is_no_mesh():
    pytest.importorskip("skimage", reason="scikit-image is not installed (extra export)")
    empty = ball_seen(camera(0.0))
    nothing = torch.full_like(empty.depth, torch.inf)
    empty = Rendering(empty.color, empty.opacity * 0, nothing, nothing)
    with pytest.raises(InputError):
        surface_mesh([camera(0.0)], [empty], lambda grid: grid, (8, 8, 8))
    assert surface_fraction([empty]) == 0


def test_a_solid_cut_out_is_a_definite_surface():
    """Pixels that show nothing counted as parts without a surface."""
    seen = ball_seen(camera(0.0))
    assert 0 < seen.opacity.mean() < 0.5
    assert surface_fraction([seen]) == 1
    mist = Rendering(seen.color, seen.opacity, 1.2 * seen.depth, seen.depth)
    assert surface_fraction([seen, mist]) == 0.5


def in_a_thin_layer(grid):
    """The layers beside the middle one have a cell length beyond the map, so they are not known."""
    return np.where(np.abs(grid[:, :1]) < 0.3, grid, np.nan)


def at_lattice_points_alone(grid):
    index = (grid + 1) * 4.5 - 0.5
    return np.where(np.isclose(index, index.round()).all(axis=1, keepdims=True), grid, np.nan)


@pytest.mark.parametrize("to_world", [in_a_thin_layer, at_lattice_points_alone])
def test_a_surface_beside_what_is_not_mapped_is_no_mesh(to_world):
    pytest.importorskip("skimage", reason="scikit-image is not installed (extra export)")
    views = [camera(angle) for angle in np.linspace(0, 2 * np.pi, 9)[:-1]]
    renders = [ball_seen(view) for view in views]
    with rejects("the field"):
        surface_mesh(views, renders, to_world, (9, 9, 9))


def test_a_lattice_keeps_its_proportions_within_the_bound():
    x, y, z = lattice_within((400, 200, 100), 1_000_000)
    assert x * y * z <= 1_000_000
    assert x / z == pytest.approx(4, rel=0.05)
    assert lattice_within((10, 10, 10), 1_000_000) == (10, 10, 10)


def test_a_glb_opens_with_its_colors_upright(tmp_path: Path):
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed (extra export)")
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    mesh = SurfaceMesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]))
    write_glb(tmp_path / "a.glb", mesh, np.array([[1.0, 0.5, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]))
    (found,) = trimesh.load(tmp_path / "a.glb", process=False).geometry.values()
    assert np.allclose(found.vertices, vertices * (1, -1, -1), atol=1e-6)
    assert np.array_equal(found.faces, mesh.triangles)
    colors = found.visual.vertex_attributes["color"]
    assert colors[0] == pytest.approx([1, ((0.5 + 0.055) / 1.055) ** 2.4, 0])  # linear


def test_a_glb_keeps_all_levels_of_a_picture(tmp_path: Path):
    """Linear colors of 8 bits have seven of the darkest forty levels."""
    pytest.importorskip("trimesh", reason="trimesh is not installed (extra export)")
    vertices = np.random.default_rng(0).normal(size=(256, 3))
    triangles = np.arange(256 - 256 % 3).reshape(-1, 3)
    levels = np.arange(256)[:, None].repeat(3, axis=1)
    write_glb(tmp_path / "a.glb", SurfaceMesh(vertices, triangles), levels / 255)
    linear = colors_of(tmp_path / "a.glb")
    low, high = linear * 12.92, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055
    encoded = np.where(linear <= 0.0031308, low, high)
    assert np.array_equal(np.rint(255 * encoded), levels)


def colors_of(path: Path) -> np.ndarray:
    """Returns the colors of a mesh's vertices by the layout of glTF 2.0."""
    content = path.read_bytes()
    size = int.from_bytes(content[12:16], "little")
    tree, data = json.loads(content[20 : 20 + size]), content[28 + size :]
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    assert set(attributes) == {"POSITION", "COLOR_0"}
    accessor = tree["accessors"][attributes["COLOR_0"]]
    assert (accessor["componentType"], accessor["type"]) == (5126, "VEC3")  # floats
    view = tree["bufferViews"][accessor["bufferView"]]
    values = np.frombuffer(data, "<f4", 3 * accessor["count"], view.get("byteOffset", 0))
    return values.reshape(-1, 3)


def test_points_open_in_another_reader(tmp_path: Path):
    pytest.importorskip("trimesh", reason="trimesh is not installed (extra export)")
    plyfile = pytest.importorskip("plyfile", reason="plyfile is not installed")
    rng = np.random.default_rng(0)
    points, colors = rng.normal(size=(50, 3)), rng.uniform(size=(50, 3))
    write_points(tmp_path / "a.ply", points, colors)
    vertices = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"]
    assert np.allclose(np.column_stack([vertices[name] for name in "xyz"]), points, atol=1e-6)
    assert np.array_equal(vertices["green"], np.round(colors[:, 1] * 255))
