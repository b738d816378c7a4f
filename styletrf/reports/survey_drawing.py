"""Cameras and points drawn from above and from the side, as inline SVG.

In the normalized world y points down: the plan is x to the right and z away, the elevation z to the
right and y down.
"""

import html
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

from styletrf.geometry.cameras import Camera

_SIDE, _MARGIN = 320, 14
_MOST_POINTS = 1500
_PLAN, _ELEVATION = (0, 2, 1.0, -1.0), (2, 1, 1.0, 1.0)  # axes across and down, and their signs


def drawings(
    cameras: Sequence[Camera],
    points: Float[np.ndarray, "points 3"],
    rgb: UInt8[np.ndarray, "points 3"],
    flagged: frozenset[str] = frozenset(),
) -> str:
    """Returns the plan and the elevation; flagged cameras are drawn in another color.

    Both show the cameras and the middle 96 % of the points along each axis.
    """
    chosen = np.linspace(0, len(points) - 1, min(len(points), _MOST_POINTS)).astype(np.int64)
    return "".join(
        _view(title, axes, cameras, points[chosen], rgb[chosen], flagged)
        for title, axes in (("From above", _PLAN), ("From the side", _ELEVATION))
    )


def _view(
    title: str,
    axes: tuple[int, int, float, float],
    cameras: Sequence[Camera],
    points: Float[np.ndarray, "points 3"],
    rgb: UInt8[np.ndarray, "points 3"],
    flagged: frozenset[str],
) -> str:
    flat = _flat(points, axes)
    centers = _flat(np.stack([camera.center_world for camera in cameras]), axes)
    low = np.minimum(np.percentile(flat, 2, axis=0), centers.min(axis=0))
    high = np.maximum(np.percentile(flat, 98, axis=0), centers.max(axis=0))
    scale = (_SIDE - 2 * _MARGIN) / max(float((high - low).max()), 1e-12)
    placed = (flat - (low + high) / 2) * scale + _SIDE / 2
    shown = ((placed > 0) & (placed < _SIDE)).all(axis=1)
    marks = [
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="1.1" fill="rgb({r},{g},{b})"/>'
        for (x, y), (r, g, b) in zip(placed[shown], rgb[shown], strict=True)
    ]
    forward = _flat(np.stack([camera.forward_world for camera in cameras]), axes)
    at = (centers - (low + high) / 2) * scale + _SIDE / 2
    marks += [
        _camera(camera.name, position, direction, camera.name in flagged)
        for camera, position, direction in zip(cameras, at, forward, strict=True)
    ]
    return (
        f"<figure><h3>{title}</h3>"
        f'<svg viewBox="0 0 {_SIDE} {_SIDE}" role="img" '
        f'aria-label="{title}: {len(cameras)} cameras and the points they see">'
        f"{''.join(marks)}</svg></figure>"
    )


def _flat(
    values: Float[np.ndarray, "n 3"], axes: tuple[int, int, float, float]
) -> Float[np.ndarray, "n 2"]:
    across, down, sign_across, sign_down = axes
    flat: Float[np.ndarray, "n 2"] = values[:, [across, down]] * (sign_across, sign_down)
    return flat


def _camera(
    name: str,
    at: Float[np.ndarray, " 2"],
    forward: Float[np.ndarray, " 2"],
    is_flagged: bool,  # noqa: FBT001
) -> str:
    """Returns a wedge that opens the way the camera looks, with its name on hover."""
    aside = np.array([-forward[1], forward[0]]) * 4
    left, right = at + 9 * forward + aside, at + 9 * forward - aside
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in (at, left, right))
    kind = "camera flagged" if is_flagged else "camera"
    return (
        f'<polygon class="{kind}" points="{corners}"><title>{html.escape(name)}</title></polygon>'
    )
