"""Packs a scene for the page's script: JSON, and the blocks of data that it names."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from styletrf.files.digests import sha256_of
from styletrf.geometry.cameras import Camera
from styletrf.viewer.baking import BakedLook
from styletrf.viewer.coding import Codes, packed_colors, packed_density
from styletrf.viewer.compression import packed_bytes
from styletrf.viewer.lattice import BrickLattice
from styletrf.viewer.point_effects import packed_classes
from styletrf.viewer.view_directions import ViewDirections
from styletrf.viewer.viewer_content import ViewerContent
from styletrf.viewer.webpage.block_text import block_text

_MOST_PIXELS_WIDE = 1600
_MOST_BYTES = 512_000_000
"""The most bytes of the textures of looks that a page keeps in the graphics card's memory."""


@dataclass(frozen=True, slots=True)
class Packed:
    """A part of the data that the script reads.

    Attributes:
        values: The values, as JSON.
        blocks: The data that it names: compressed, as text of `block_text`.
    """

    values: dict[str, Any]
    blocks: dict[str, str] = field(default_factory=dict)


def packed_scene(content: ViewerContent, frames_per_second: float) -> Packed:
    """Returns all but the looks; `frames_per_second` are those of the fly-through."""
    density, render, blocks = content.density, content.render, dict[str, str]()
    differences, counts = packed_density(density.codes.codes, density.lattice.needed)
    numbers = {
        "uDepthMin": content.space.depth_min,
        "uStep": content.step_length,
        "uScale": density.scale,
        "uShift": density.shift,
        "uTermination": render.termination,
        "uMinWeight": render.min_weight,
    }
    empty = np.ascontiguousarray(density.distances.transpose(2, 1, 0))
    values = {
        "name": content.scene,
        "maps": content.space.grid_from_world.reshape(-1, 16).tolist(),
        "axisLengths": list(content.space.axis_lengths),
        "march": numbers,
        "density": {
            "lattice": _lattice(density.lattice, blocks),
            "values": _block(differences, blocks),
            "counts": counts,
            "low": density.codes.low,
            "step": density.codes.step,
        },
        "empty": {
            "size": list(density.distances.shape),
            "values": _block(packed_bytes(empty), blocks),
        },
        "path": [_view(camera) for camera in content.path],
        "guides": [{"center": c, "ahead": a} for c, a in content.bounds.guides],
        "down": list(content.bounds.down),
        "radius": content.bounds.radius,
        "reach": content.bounds.reach_rad,
        "focus": list(content.focus),
        "looking": content.looking,
        "mostPixels": _MOST_PIXELS_WIDE,
        "mostBytes": _MOST_BYTES,
        "framesPerSecond": frames_per_second,
        "worldFromNormalized": content.world_from_normalized.reshape(-1).tolist(),
    }
    return Packed(values, blocks)


def packed_look(look: BakedLook, thumbnail: str) -> Packed:
    """Returns a look; its thumbnail is a `data:` URI."""
    blocks: dict[str, str] = {}
    classes, counts = packed_classes(look.classes)
    values = {
        "name": look.name,
        "thumbnail": thumbnail,
        "lattice": _lattice(look.lattice, blocks),
        "classes": {"values": _block(classes, blocks), "counts": _block(counts, blocks)},
        "spacings": list(look.spacings),
        "colors": _values(look, look.codes, blocks),
        "slopes": _values(look, look.slope_codes, blocks) if look.slope_codes else None,
        "directions": _directions(look.directions, blocks),
        "power": look.weight_power,
        "background": list(look.background),
    }
    return Packed(values, blocks)


def _values(look: BakedLook, codes: Codes, blocks: dict[str, str]) -> dict[str, Any]:
    """Returns values that a texture of 8 bits holds, by the values of its 0 and 255."""
    packed = packed_colors(codes, look.classes, look.spacings)
    bounds = {"low": codes.low, "high": codes.low + 255 * codes.step, "byGreen": codes.by_green}
    return {"values": _block(packed, blocks), **bounds}


def _directions(directions: ViewDirections | None, blocks: dict[str, str]) -> str | None:
    """Returns the block with the axes of directions, row by row, and the tint."""
    if directions is None:
        return None
    names = ("mean", "axes", "least", "most", "tint")  # as OF_DIRECTIONS of unpacking.js
    parts = [getattr(directions, name).ravel() for name in names]
    return _block(packed_bytes(np.concatenate(parts).astype("<f4").view(np.uint8)), blocks)


def _lattice(lattice: BrickLattice, blocks: dict[str, str]) -> dict[str, Any]:
    present = (lattice.slots.transpose(2, 1, 0) >= 0).astype(np.uint8)
    packed = packed_bytes(present)
    return {"resolution": list(lattice.resolution), "present": _block(packed, blocks)}


def _block(packed: bytes, blocks: dict[str, str]) -> str:
    """Adds a block of data, unless it is there, and returns its name."""
    name = "data-" + sha256_of(packed)[:16]
    blocks[name] = block_text(packed)
    return name


def _view(camera: Camera) -> dict[str, Any]:
    lens = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    return {"pose": camera.world_from_camera.reshape(-1).tolist(), **lens}
