"""The page: bricks, cameras and scripts in one HTML file that needs no network."""

import codecs
import hashlib
import html
import json
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from string import Template

from styletrf.files.atomic_write import atomic_write
from styletrf.viewer.lattice import BrickLattice
from styletrf.viewer.viewer_content import ViewerContent
from styletrf.viewer.webpage.packed_scene import Packed, packed_look, packed_scene

_TEMPLATE = Path(__file__).with_name("viewer.html").read_text(encoding="utf-8")
_STYLE = Path(__file__).with_name("viewer.css").read_text(encoding="utf-8")
_MARCH = Path(__file__).with_name("march.glsl").read_text(encoding="utf-8")
_SCRIPTS = (
    Path(__file__).with_name("unpacking.js"),
    Path(__file__).with_name("renderer.js"),
    Path(__file__).with_name("look_memory.js"),
    Path(__file__).with_name("chosen_looks.js"),
    Path(__file__).with_name("navigation.js"),
    Path(__file__).with_name("camera_curve.js"),
    Path(__file__).with_name("path_editor.js"),
    Path(__file__).with_name("live.js"),
    Path(__file__).with_name("loop.js"),
    Path(__file__).with_name("input.js"),
    Path(__file__).with_name("interface.js"),
)
_SCRIPT = "\n".join(script.read_text(encoding="utf-8") for script in _SCRIPTS)


def write_viewer(
    path: Path,
    content: ViewerContent,
    thumbnails: Sequence[str],
    frames_per_second: float,
    *,
    fetched: bool = False,
) -> None:
    """Writes the page as one file.

    Args:
        path: The file to write.
        content: The content of the page.
        thumbnails: The thumbnails of the looks, as `data:` URIs.
        frames_per_second: The rate of the fly-through.
        fetched: Whether the shader weighs the eight points around a sample itself, instead of the
            graphics card's filter.
    """
    scene = packed_scene(content, frames_per_second)
    looks = [packed_look(*each) for each in zip(content.looks, thumbnails, strict=True)]
    scene.values["fetched"] = fetched
    with atomic_write(path) as partial:
        partial.write_bytes(encoded_page(viewer_page(content, scene, looks)))


def viewer_page(
    content: ViewerContent, scene: Packed, looks: Sequence[Packed], *, is_live: bool = False
) -> str:
    """Returns the page; names are escaped, and only its own script may run.

    Args:
        content: The content of the page, for its title and its description.
        scene: All but the looks.
        looks: The looks of the photographs and the paintings.
        is_live: Whether the page requests more looks from its server, and nothing else.
    """
    values = scene.values | {"looks": [look.values for look in looks], "isLive": is_live}
    blocks = {name: block for part in (scene, *looks) for name, block in part.blocks.items()}
    script, style = f"(() => {{\n{_SCRIPT}}})();\n", f"\n{_STYLE}"
    policy = (
        f"default-src 'none'; script-src '{_digest(chr(10) + script)}'; "
        f"style-src '{_digest(style)}'; img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    return Template(_TEMPLATE).substitute(
        title=html.escape(content.scene),
        policy=policy + ("; connect-src 'self'" if is_live else ""),
        style=style,
        about=about(content),
        script=script,
        march=_MARCH,
        scene=json.dumps(values).replace("<", "\\u003c"),
        blocks="\n".join(
            f'<script type="text/plain" id="{name}">{block}</script>'
            for name, block in blocks.items()
        ),
    )


def encoded_page(page: str) -> bytes:
    """Returns a page as bytes in UTF-16, for its data.

    The mark at their beginning outranks the encodings that a server and the page declare. Saved
    again in UTF-8, the page has the encoding that it declares.
    """
    return codecs.BOM_UTF16_LE + page.encode("utf-16-le")


def about(content: ViewerContent) -> str:
    """Returns the size of the baked scene and its loss, as HTML."""
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


def _digest(text: str) -> str:
    return "sha256-" + b64encode(hashlib.sha256(text.encode()).digest()).decode()
