"""`capture.json`: a scene's photographs as all later stages read them."""

import json
import logging
from dataclasses import asdict, dataclass
from pathlib import Path

_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Photograph:
    """One photograph of a capture; `width` and `height` are those of its upright pixels.

    A frame of a video has its `clip`, the number of cuts before it there (`shot`), and its time in
    seconds since the clip's first frame. A view cut from a panorama has the panorama's name and its
    direction there (see `styletrf.capture.panorama.panorama_views`).
    """

    name: str
    file: str
    width: int
    height: int
    size_bytes: int
    sha256: str
    clip: str | None = None
    shot: int = 0
    time_s: float | None = None
    panorama: str | None = None
    direction: str | None = None


@dataclass(frozen=True, slots=True)
class Capture:
    """A scene's photographs in natural order, and the warnings about them."""

    photographs: tuple[Photograph, ...]
    warnings: tuple[str, ...]


def write_capture(out_dir: Path, capture: Capture) -> None:
    """Writes `capture.json`, and logs the warnings."""
    text = json.dumps(asdict(capture), sort_keys=True, indent=1, ensure_ascii=False)
    (out_dir / "capture.json").write_text(text + "\n", encoding="utf-8")
    for warning in capture.warnings:
        _LOGGER.warning(warning)


def read_capture(capture_dir: Path) -> Capture:
    """Returns the capture that `capture_photographs` wrote."""
    text = (capture_dir / "capture.json").read_text(encoding="utf-8")
    content = json.loads(text)
    photographs = tuple(Photograph(**row) for row in content["photographs"])
    return Capture(photographs, tuple(content["warnings"]))
