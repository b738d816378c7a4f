"""The courtyard with its daylight in place, ready for rays.

A flat panel keeps its light in its texture, so that the shadow of a bar stays sharp; everything
else, being small, keeps it at its vertices.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.synthetic.courtyard.lighting import Points, skylight, sunlight
from styletrf.synthetic.courtyard.mesh import joined
from styletrf.synthetic.courtyard.rays import Hierarchy, build_hierarchy
from styletrf.synthetic.courtyard.scene import Part, courtyard_parts
from styletrf.synthetic.courtyard.shading import Surfaces
from styletrf.synthetic.courtyard.surround import surround_parts
from styletrf.synthetic.courtyard.textures import Texture

_SUN_PER_METER = 40
_SKY_PER_METER = 7
_THROUGH_LEAF = 0.45

Light = Callable[[Hierarchy, Points, Points], Points]


@lru_cache(maxsize=4)  # every kind of one seed
def lit_courtyard(seed: int, *, glossy: bool, surround: bool = False) -> Surfaces:
    """Returns the courtyard of a seed, the same arrays for the same arguments."""
    around = surround_parts(seed) if surround else []
    return lit_parts([*courtyard_parts(seed, glossy=glossy), *around])


def lit_parts(parts: Sequence[Part]) -> Surfaces:
    """Returns parts of any place with their daylight."""
    mesh = joined([part.mesh for part in parts])
    tree, order = build_hierarchy(mesh.vertices, mesh.triangles)
    textures = [_lit_texture(part, tree) for part in parts]
    starts = np.cumsum([0] + [texture.size // 3 for texture in textures])
    rows = [
        (start, *texture.shape[:2], part.glossy)
        for start, texture, part in zip(starts[:-1], textures, parts, strict=True)
    ]
    counts = [len(part.mesh.triangles) for part in parts]
    vertices = np.concatenate([mesh.uv, _vertex_light(parts, tree), mesh.normals], axis=1)
    return Surfaces(
        tree=tree,
        corners=vertices[mesh.triangles[order]],
        textures=np.repeat(np.array(rows, dtype=np.int64), counts, axis=0)[order],
        texels=np.concatenate([texture.reshape(-1, 3) for texture in textures]),
    )


def _vertex_light(parts: Sequence[Part], tree: Hierarchy) -> Float[np.ndarray, "vertices 3"]:
    """Returns the light at all vertices; 1 where a panel's texture has it already."""
    return np.concatenate(
        [
            np.ones_like(part.mesh.vertices) if part.panel_size else _light_at(part, tree)
            for part in parts
        ]
    )


def _light_at(part: Part, tree: Hierarchy) -> Float[np.ndarray, "vertices 3"]:
    points, normals = part.mesh.vertices, part.mesh.normals
    front = np.asarray(sunlight(tree, points, normals) + skylight(tree, points, normals))
    if not part.translucent:
        return front
    back = sunlight(tree, points, -normals) + skylight(tree, points, -normals)
    bright, dim = np.maximum(front, back), np.minimum(front, back)
    return np.asarray((1 - _THROUGH_LEAF) * bright + _THROUGH_LEAF * np.maximum(dim, 0.6 * bright))


def _lit_texture(part: Part, tree: Hierarchy) -> Texture:
    if part.panel_size is None:
        return part.texture
    sun = _panel_light(part, part.panel_size, tree, sunlight, _SUN_PER_METER)
    sky = _panel_light(part, part.panel_size, tree, skylight, _SKY_PER_METER)
    return np.asarray(part.texture * (sun + sky))


def _panel_light(
    part: Part, size: tuple[float, float], tree: Hierarchy, light: Light, per_meter: int
) -> Texture:
    """Returns one kind of light on a panel, computed on a coarser lattice than its texture's."""
    width, height = (max(2, round(side * per_meter)) for side in size)
    v, u = (np.mgrid[0:height, 0:width].reshape(2, -1) + 0.5) / [[height], [width]]
    origin, right, _, down = part.mesh.vertices
    points = origin + u[:, None] * (right - origin) + v[:, None] * (down - origin)
    normals = np.broadcast_to(part.mesh.normals[0], points.shape).copy()
    lattice = light(tree, points, normals).reshape(height, width, 3).astype(np.float32)
    texels = part.texture.shape[1], part.texture.shape[0]
    return np.asarray(cv2.resize(lattice, texels, interpolation=cv2.INTER_LINEAR))
