"""Measures how well photographs support a path: the share of pixels that too few of them show.

A field is free where few photographs constrain it. A pixel of a frame is unsupported if fewer than
three photographs see the surface there: the point behind it, by the field's own depth, has to lie
within the photograph and not behind another surface, again by the field's depth.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from styletrf.even_spread import evenly_spread
from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.geometry.cameras import (
    Camera,
    depth_behind,
    finite_depth,
    fitted_to,
    pixel_centers,
    points_at_depth,
)
from styletrf.geometry.space import Space
from styletrf.scene.survey import ENOUGH_VIEWS
from styletrf.trajectory.frames import rendered
from styletrf.trajectory.support_config import SupportConfig

Depth = Float[np.ndarray, "height width"]

_DEPTH_ALONE = RenderConfig(termination=1e-2, min_weight=1.0)  # no sample gets a color


@dataclass(frozen=True, slots=True)
class Support:
    """The share of the pixels that fewer than three photographs see, by the names of frames."""

    unsupported: dict[str, float]

    @property
    def share(self) -> float:
        """The share of all pixels."""
        return float(np.mean(list(self.unsupported.values())))

    def worst(self, count: int = 3) -> list[str]:
        """Returns the names of the frames with the largest shares, the largest first."""
        return sorted(self.unsupported, key=lambda name: -self.unsupported[name])[:count]


class SupportMeter:
    """Measures the support of paths by some photographs, whose depth it renders once.

    Args:
        photographs: Those that the field was fitted to, in the normalized world.
        radiance: The field.
        space: Of the field.
        config: How to measure.
        device: Where to render depth.
    """

    def __init__(
        self, photographs: Sequence[Camera], radiance: RadianceField, space: Space,
        config: SupportConfig, device: torch.device,
    ) -> None:  # fmt: skip
        self.config = config
        self._field = radiance, space, device
        self._photographs = [fitted_to(camera, config.depth_px) for camera in photographs]
        self._depths = self._depths_of(self._photographs)

    def measure(self, path: Sequence[Camera]) -> Support:
        """Returns the support of frames spread over a path."""
        some = evenly_spread(path, self.config.frames)
        cameras = [fitted_to(camera, self.config.depth_px) for camera in some]
        depths = self._depths_of(cameras)
        shares = {}
        for camera, depth in zip(cameras, depths, strict=True):
            seen = photographs_seeing(camera, depth, self._photographs, self._depths, self.config)
            shares[camera.name] = float((seen < ENOUGH_VIEWS).mean())
        return Support(shares)

    def _depths_of(self, cameras: Sequence[Camera]) -> list[Depth]:
        radiance, space, device = self._field
        renders = rendered(radiance, space, cameras, _DEPTH_ALONE, device)
        return [one.median_depth.numpy() for one in renders]


def photographs_seeing(
    camera: Camera,
    depth: Depth,
    photographs: Sequence[Camera],
    depths: Sequence[Depth],
    config: SupportConfig,
) -> Int[np.ndarray, " pixels"]:
    """Returns how many photographs see what each pixel of a camera does, row by row.

    Args:
        camera: Of the pixels.
        depth: Its depth Z; infinite where nothing is hit.
        photographs: Cameras.
        depths: Theirs.
        config: Which surfaces are the same.
    """
    pixels = pixel_centers(camera.width, camera.height)
    points = points_at_depth(camera, pixels, finite_depth(depth).reshape(-1))
    seen = np.zeros(len(points), np.int64)
    for photograph, found in zip(photographs, depths, strict=True):
        baseline = float(np.linalg.norm(photograph.center_world - camera.center_world))
        seen += _sees(photograph, finite_depth(found), points, baseline, config)
    return seen


def _sees(
    photograph: Camera, depth: Depth, points: Float[np.ndarray, "points 3"], baseline: float,
    config: SupportConfig,
) -> Bool[np.ndarray, " points"]:  # fmt: skip
    """Returns which points a photograph sees.

    A difference in inverse depth shifts a point by at most `f baseline` times as much between two
    images; where that is below `parallax_px`, the photographs could not distinguish the surfaces.
    """
    _, expected, found, inside = depth_behind(photograph, depth, points)
    safe = np.where(inside, expected, 1.0)
    slack = config.tolerance / safe
    if baseline > 0:
        slack = np.maximum(slack, config.parallax_px / (photograph.fx * baseline))
    same = np.abs(1 / found - 1 / safe) <= slack
    visible: Bool[np.ndarray, " points"] = inside & (same if baseline > 0 else True)
    return visible
