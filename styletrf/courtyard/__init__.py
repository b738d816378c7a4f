"""The embedded scene: a small ray-traced courtyard, photographed from exactly known cameras.

It enters the pipeline as photographs; its truth (cameras, depth, flow) serves the tests.
`python -m styletrf.courtyard DIR` writes it.
"""

from styletrf.courtyard.capture import (
    KINDS,
    Capture,
    CourtyardConfig,
    capture_courtyard,
    courtyard_cameras,
    render_view,
)
from styletrf.exact_flow import exact_flow

__all__ = [
    "KINDS",
    "Capture",
    "CourtyardConfig",
    "capture_courtyard",
    "courtyard_cameras",
    "exact_flow",
    "render_view",
]
