"""Points and meshes of a scene in all its styles."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from styletrf.exports.export_views import ExportViews, Look, point_colors
from styletrf.exports.splat_placement import voxel_means, voxels_of
from styletrf.exports.surface_files import write_glb, write_points
from styletrf.exports.surface_mesh import (
    SurfaceMesh,
    lattice_within,
    surface_fraction,
    surface_mesh,
    vertex_colors,
)
from styletrf.progress import Progress

MOST_POINTS = 1_000_000
MOST_LATTICE_POINTS = 4_000_000
ENOUGH_SURFACE = 0.8


def export_points(
    out: Path, views: ExportViews, looks: Sequence[Look], progress: Progress
) -> dict[str, Any]:
    """Writes `NAME.ply` for each look: the same points, each the mean of a voxel's.

    Args:
        out: The folder to fill.
        views: The views whose pixels give the points.
        looks: The names of looks and the loaders of their fields.
        progress: Called after every look.

    Returns:
        The number of points, and the fraction of the pictures that shows a surface.

    Raises:
        InputError: There is no surface at all.
    """
    points = views.points()
    voxel = voxels_of(views.to_grid(points.positions), views.field.resolution, MOST_POINTS)
    world = _in_world(views, voxel_means(points.positions, voxel))
    for number, (name, load) in enumerate(looks):
        colors = point_colors(views.renders, views.pictures(load()))
        write_points(out / f"{name}.ply", world, voxel_means(colors, voxel))
        progress(number + 1, len(looks))
    return {"points": len(world), **_surface_in_words(views)}


def export_mesh(
    out: Path, views: ExportViews, looks: Sequence[Look], progress: Progress
) -> dict[str, Any]:
    """Writes `NAME.glb` for each look: the same mesh, with the look's colors at its vertices.

    Args:
        out: The folder to fill.
        views: The views whose depths are fused.
        looks: The names of looks and the loaders of their fields.
        progress: Called after every look.

    Returns:
        The size of the mesh, and the fraction of the pictures that shows a surface.

    Raises:
        InputError: There is no surface at all.
    """
    space = views.model.space.within(views.field.bounds)
    resolution = lattice_within(views.field.resolution, MOST_LATTICE_POINTS)
    mesh = surface_mesh(views.cameras, views.renders, space.to_world, resolution)
    in_world = SurfaceMesh(_in_world(views, mesh.vertices), mesh.triangles)
    depths = [render.median_depth.numpy() for render in views.renders]
    for number, (name, load) in enumerate(looks):
        colors = vertex_colors(mesh, views.cameras, depths, views.pictures(load()))
        write_glb(out / f"{name}.glb", in_world, colors)
        progress(number + 1, len(looks))
    sizes = {"vertices": len(mesh.vertices), "triangles": len(mesh.triangles)}
    return {**sizes, **_surface_in_words(views)}


def _surface_in_words(views: ExportViews) -> dict[str, Any]:
    fraction = surface_fraction(views.renders)
    word = "a surface in most of the pictures"
    if fraction < ENOUGH_SURFACE:
        word = "no definite surface in much of the pictures; splats show them better"
    return {"surface_share": fraction, "note": word}


def _in_world(views: ExportViews, points: np.ndarray) -> np.ndarray:
    """Returns points of the normalized world in COLMAP's."""
    world_from_normalized = np.linalg.inv(views.model.normalized_from_world)
    world: np.ndarray = points @ world_from_normalized[:3, :3].T + world_from_normalized[:3, 3]
    return world
