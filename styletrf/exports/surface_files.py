"""Colored points as `.ply` and meshes as `.glb`, written by trimesh."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from styletrf.exports.splat_files import UP_FROM_DOWN
from styletrf.exports.surface_mesh import SurfaceMesh
from styletrf.files.atomic_write import atomic_write

_UNLIT = "KHR_materials_unlit"
_COLORS = "_LINEAR"  # an attribute of our own, since trimesh rounds its colors to 8 bits


def write_points(
    path: Path, points_world: Float[np.ndarray, "points 3"], colors: Float[np.ndarray, "points 3"]
) -> None:
    """Writes a binary `.ply` of points with red, green, blue and alpha; colors in [0, 1]."""
    cloud = import_module("trimesh").PointCloud(points_world, colors=_opaque(colors))
    with atomic_write(path) as partial:
        partial.write_bytes(cloud.export(file_type="ply"))


def write_glb(path: Path, mesh: SurfaceMesh, colors: Float[np.ndarray, "vertices 3"]) -> None:
    """Writes a mesh with a color at each vertex, to be shown as it is, without light.

    glTF's world has x right, y up, z back, and its colors are linear: as floats, since 8 bits
    would leave few dark levels.
    """
    trimesh = import_module("trimesh")
    shape = trimesh.Trimesh(
        mesh.vertices @ UP_FROM_DOWN[:3, :3].T, mesh.triangles,
        vertex_attributes={_COLORS: _linear(np.clip(colors, 0, 1)).astype(np.float32)},
        process=False,
    )  # fmt: skip
    export = import_module("trimesh.exchange.gltf").export_glb
    with atomic_write(path) as partial:
        partial.write_bytes(export(trimesh.Scene(shape), tree_postprocessor=_finish))


def _finish(tree: dict[str, Any]) -> None:
    """Makes the attribute the colors, and gives the mesh a material that light does not change."""
    plain = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    tree["materials"] = [{"pbrMetallicRoughness": plain, "extensions": {_UNLIT: {}}}]
    tree["extensionsUsed"] = sorted({*tree.get("extensionsUsed", []), _UNLIT})
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["material"] = 0
            primitive["attributes"]["COLOR_0"] = primitive["attributes"].pop(_COLORS)


def _linear(colors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Returns the linear values of sRGB-encoded ones (IEC 61966-2-1)."""
    low = colors / 12.92
    high = ((np.maximum(colors, 0) + 0.055) / 1.055) ** 2.4
    linear: Float[np.ndarray, "n 3"] = np.where(colors <= 0.04045, low, high)
    return linear


def _opaque(colors: Float[np.ndarray, "n 3"]) -> UInt8[np.ndarray, "n 4"]:
    levels = np.clip(np.round(colors * 255), 0, 255).astype(np.uint8)
    return np.concatenate([levels, np.full((len(levels), 1), 255, np.uint8)], axis=1)
