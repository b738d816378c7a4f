"""The page: bricks, cameras and scripts in one HTML file that asks nothing of any network."""

import hashlib
import html
import json
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from styletrf.files.atomic_write import atomic_write
from styletrf.geometry.cameras import Camera
from styletrf.viewer.baking import BakedLook
from styletrf.viewer.coding import COLOR_LEVELS, Codes, packed_bytes, packed_codes
from styletrf.viewer.lattice import BrickLattice
from styletrf.viewer.viewer_content import ViewerContent

_TEMPLATE = Path(__file__).with_name("viewer.html").read_text(encoding="utf-8")
_STYLE = Path(__file__).with_name("viewer.css").read_text(encoding="utf-8")
_MARCH = Path(__file__).with_name("march.glsl").read_text(encoding="utf-8")
_SCRIPTS = (
    Path(__file__).with_name("unpacking.js"),
    Path(__file__).with_name("renderer.js"),
    Path(__file__).with_name("navigation.js"),
    Path(__file__).with_name("loop.js"),
    Path(__file__).with_name("interface.js"),
)
_SCRIPT = "\n".join(script.read_text(encoding="utf-8") for script in _SCRIPTS)
_MOST_PIXELS_WIDE = 1600


def write_viewer(
    path: Path,
    content: ViewerContent,
    thumbnails: Sequence[str],
    frames_per_second: float,
    *,
    fetched: bool = False,
) -> None:
    """Writes the page; names are escaped, and only its own script may run.

    Args:
        path: Where to.
        content: What it shows.
        thumbnails: Of the looks, as `data:` URIs.
        frames_per_second: Of the fly-through.
        fetched: Whether the shader weighs the eight points around a sample itself, instead of the
            graphics card's filter.
    """
    blocks: dict[str, str] = {}
    looks = [_look(look, blocks) for look in content.looks]
    for look, thumbnail in zip(looks, thumbnails, strict=True):
        look["thumbnail"] = thumbnail
    options = {"framesPerSecond": frames_per_second, "fetched": fetched, "looks": looks}
    scene = _scene(content, blocks) | options
    script, style = f"(() => {{\n{_SCRIPT}}})();\n", f"\n{_STYLE}"
    policy = (
        f"default-src 'none'; script-src '{_digest(chr(10) + script)}'; "
        f"style-src '{_digest(style)}'; img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    page = Template(_TEMPLATE).substitute(
        title=html.escape(content.scene),
        policy=policy,
        style=style,
        about=about(content),
        script=script,
        march=_MARCH,
        scene=json.dumps(scene).replace("<", "\\u003c"),
        blocks="\n".join(blocks.values()),
    )
    with atomic_write(path) as partial:
        partial.write_text(page, encoding="utf-8", newline="\n")


def about(content: ViewerContent) -> str:
    """Returns what was baked and what it lost, as HTML."""
    density = content.density
    rows = [("density", _lattice_in_words(density.lattice))]
    if density.reduced_from:
        rows.append(("density", _reduced(density.reduced_from, density.psnr_db)))
    for look in content.looks:
        how = "fitted to all directions" if look.slope_codes else "exact but for rounding"
        words = f"{_lattice_in_words(look.lattice)}; {how}: {look.psnr_db:.1f} dB"
        rows.append((look.name, words))
        if look.reduced_from:
            rows.append((look.name, _reduced(look.reduced_from, look.psnr_db)))
    cells = "".join(
        f'<tr><th scope="row">{html.escape(name)}</th><td>{html.escape(words)}</td></tr>'
        for name, words in rows
    )
    return f'<table class="quiet small">{cells}</table>'


def _lattice_in_words(lattice: BrickLattice) -> str:
    x, y, z = lattice.resolution
    return f"{int(lattice.needed.sum()):,} of {x} x {y} x {z} points"


def _reduced(points: tuple[int, int, int], psnr_db: float) -> str:
    x, y, z = points
    problem = f"Its lattice of {x} x {y} x {z} points is too large for a page and was made coarser"
    return f"{problem}: pictures are within {psnr_db:.1f} dB of those of the field."


def _scene(content: ViewerContent, blocks: dict[str, str]) -> dict[str, Any]:
    """Returns what the script reads as JSON; adds the blocks that it names."""
    density, render = content.density, content.render
    needed = density.lattice.needed
    numbers = {
        "uDepthMin": content.space.depth_min,
        "uStep": content.step_length,
        "uScale": density.scale,
        "uShift": density.shift,
        "uTermination": render.termination,
        "uMinWeight": render.min_weight,
    }
    empty = np.ascontiguousarray(density.distances.transpose(2, 1, 0))
    return {
        "name": content.scene,
        "maps": content.space.grid_from_world.reshape(-1, 16).tolist(),
        "axisLengths": list(content.space.axis_lengths),
        "march": numbers,
        "density": {
            "lattice": _lattice(density.lattice, blocks),
            "values": _block(packed_codes(density.codes.codes, needed, 2), blocks),
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
    }


def _look(look: BakedLook, blocks: dict[str, str]) -> dict[str, Any]:
    return {
        "name": look.name,
        "lattice": _lattice(look.lattice, blocks),
        "colors": _values(look.codes, look.lattice, blocks),
        "slopes": _values(look.slope_codes, look.lattice, blocks) if look.slope_codes else None,
        "meanDirection": list(look.mean_direction),
        "power": look.weight_power,
        "background": list(look.background),
    }


def _values(codes: Codes, lattice: BrickLattice, blocks: dict[str, str]) -> dict[str, Any]:
    """Returns values that a texture of 8 bits holds, by what its 0 and 255 stand for."""
    packed, gain = packed_codes(codes.codes, lattice.needed, 1), 256 // COLOR_LEVELS
    bounds = {"low": codes.low, "high": codes.low + 255 / gain * codes.step, "gain": gain}
    return {"values": _block(packed, blocks), **bounds}


def _lattice(lattice: BrickLattice, blocks: dict[str, str]) -> dict[str, Any]:
    present = (lattice.slots.transpose(2, 1, 0) >= 0).astype(np.uint8)
    packed = packed_bytes(present)
    return {"resolution": list(lattice.resolution), "present": _block(packed, blocks)}


def _block(packed: bytes, blocks: dict[str, str]) -> str:
    """Adds a block of data to the page, unless it is there, and returns its name."""
    name = "data-" + hashlib.sha256(packed).hexdigest()[:16]
    content = b64encode(packed).decode()
    blocks[name] = f'<script type="text/plain" id="{name}">{content}</script>'
    return name


def _view(camera: Camera) -> dict[str, Any]:
    lens = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    return {"pose": camera.world_from_camera.reshape(-1).tolist(), **lens}


def _digest(text: str) -> str:
    return "sha256-" + b64encode(hashlib.sha256(text.encode()).digest()).decode()
