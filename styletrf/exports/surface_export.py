"""Points and meshes of a scene in all its styles."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from styletrf.exports.export_views import (
    ExportViews,
    Look,
    point_colors,
    stored_from_normalized,
)
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
from styletrf.scene.placement import transformed

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
    stored = _stored(views, voxel_means(points.positions, voxel))
    for number, (name, load) in enumerate(looks):
        colors = point_colors(views.renders, views.pictures(load()))
        write_points(out / f"{name}.ply", stored, voxel_means(colors, voxel))
        progress(number + 1, len(looks))
    return {"points": len(stored), **_surface_in_words(views)}


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
    stored = SurfaceMesh(_stored(views, mesh.vertices), mesh.triangles)
    depths = [render.median_depth.numpy() for render in views.renders]
    for number, (name, load) in enumerate(looks):
        colors = vertex_colors(mesh, views.cameras, depths, views.pictures(load()))
        write_glb(out / f"{name}.glb", stored, colors)
        progress(number + 1, len(looks))
    sizes = {"vertices": len(mesh.vertices), "triangles": len(mesh.triangles)}
    return {**sizes, **_surface_in_words(views)}


def _surface_in_words(views: ExportViews) -> dict[str, Any]:
    fraction = surface_fraction(views.renders)
    word = "a surface in most of the pictures"
    if fraction < ENOUGH_SURFACE:
        word = "no definite surface in much of the pictures; splats show them better"
    return {"surface_share": fraction, "note": word}


def _stored(views: ExportViews, points: np.ndarray) -> np.ndarray:
    """Returns points of the normalized world as files have them."""
    return transformed(stored_from_normalized(views.model), points)
