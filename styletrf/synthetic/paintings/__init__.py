"""Four style images by the project's own code: stained glass, brush strokes, ink waves, dots.

Enters: a seed. Leaves: a painting, `height width 3` uint8 sRGB, 512 x 512, the same for the same
seed. Begin with `stained_glass`; `canvas` has what all four draw with.
`python -m styletrf.synthetic.paintings OUT_DIR` writes them, as those in `data/styles`.
"""

from collections.abc import Callable
from pathlib import Path

import cv2

from styletrf.synthetic.paintings.brush import brush
from styletrf.synthetic.paintings.canvas import Painting
from styletrf.synthetic.paintings.dots import dots
from styletrf.synthetic.paintings.ink_waves import ink_waves
from styletrf.synthetic.paintings.stained_glass import stained_glass

__all__ = ["PAINTINGS", "brush", "dots", "ink_waves", "stained_glass", "write_paintings"]

PAINTINGS: dict[str, Callable[[int], Painting]] = {
    "stained_glass": stained_glass,
    "brush": brush,
    "ink_waves": ink_waves,
    "dots": dots,
}
_JPEG_QUALITY = 88


def write_paintings(folder: Path, seed: int = 0) -> list[Path]:
    """Writes all paintings as JPEG files and returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, paint in PAINTINGS.items():
        bgr = cv2.cvtColor(paint(seed), cv2.COLOR_RGB2BGR)
        _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        paths.append(folder / f"{name}.jpg")
        paths[-1].write_bytes(encoded.tobytes())
    return paths
