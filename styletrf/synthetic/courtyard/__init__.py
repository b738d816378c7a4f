"""The embedded scene: a small ray-traced courtyard, photographed from exactly known cameras.

Enters: a `CourtyardConfig`. Leaves: photographs, which enter the pipeline as any others do, and
the truth (cameras, depth, flow) for tests. Begin with `capture`; the geometry is in `scene`.
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
