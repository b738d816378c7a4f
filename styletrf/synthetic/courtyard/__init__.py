"""The embedded scene: a small ray-traced courtyard, photographed from exactly known cameras.

It enters the pipeline as photographs; its truth (cameras, depth, flow) serves the tests.
`python -m styletrf.synthetic.courtyard DIR` writes it.
"""

from styletrf.geometry.exact_flow import exact_flow
from styletrf.synthetic.courtyard.capture import (
    KINDS,
    Capture,
    CourtyardConfig,
    capture_courtyard,
    courtyard_cameras,
    render_view,
)

__all__ = [
    "KINDS",
    "Capture",
    "CourtyardConfig",
    "capture_courtyard",
    "courtyard_cameras",
    "exact_flow",
    "render_view",
]
