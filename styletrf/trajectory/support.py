"""Measures how well photographs support a path: the fraction of pixels that too few of them show.

A field is arbitrary where few photographs constrain it. A pixel of a frame is unsupported if fewer
than three photographs see the surface there: the point behind it, by the field's own depth, has to
lie within the photograph and not behind another surface, again by the field's depth. Where the
field has nothing but its background, a photograph that shows something else there sees none of it:
so the flat border of a field that ends before the photographs do is unsupported.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from styletrf.capture.view_images import Image
from styletrf.capture.views import load_views
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

_SAME_COLOR = 0.1  # root mean square over the channels, up to which a color is the background
_AROUND_PX = 7  # window in which other colors are counted
_MANY = 1 / 3  # of the window: silhouettes and gaps between leaves are less
_DEPTH_ALONE = RenderConfig(termination=1e-2, min_weight=1.0)  # no sample gets a color


@dataclass(frozen=True, slots=True)
class Support:
    """The fraction of the pixels that fewer than three photographs see, by the names of frames."""

    unsupported: dict[str, float]

    @property
    def fraction(self) -> float:
        """The fraction of all pixels."""
        return float(np.mean(list(self.unsupported.values())))

    def worst(self, count: int = 3) -> list[str]:
        """Returns the names of the frames with the largest fractions, the largest first."""
        return sorted(self.unsupported, key=lambda name: -self.unsupported[name])[:count]


class SupportMeter:
    """Measures the support of paths by some photographs, whose depth it renders once.

    Args:
        photographs: Those that the field was fitted to, in the normalized world.
        radiance: The field.
        space: The space of the field.
        config: The settings of the measurement.
        device: The device that renders depth.
        folder: The folder of the photographs; where it is None, their background counts as that of
            the field.
    """

    def __init__(
        self, photographs: Sequence[Camera], radiance: RadianceField, space: Space,
        config: SupportConfig, device: torch.device, folder: Path | None = None,
    ) -> None:  # fmt: skip
        self.config = config
        self._field = radiance, space, device
        self._photographs = [fitted_to(camera, config.depth_px) for camera in photographs]
        self._depths = self._depths_of(self._photographs)
        if folder is not None:
            self._compare_with(folder)

    def measure(self, path: Sequence[Camera]) -> Support:
        """Returns the support of frames spread over a path."""
        some = evenly_spread(path, self.config.frames)
        cameras = [fitted_to(camera, self.config.depth_px) for camera in some]
        depths = self._depths_of(cameras)
        fractions = {}
        for camera, depth in zip(cameras, depths, strict=True):
            seen = photographs_seeing(camera, depth, self._photographs, self._depths, self.config)
            fractions[camera.name] = float((seen < ENOUGH_VIEWS).mean())
        return Support(fractions)

    def _compare_with(self, folder: Path) -> None:
        """Sets the depths to 0 where the photographs show something that the field lacks."""
        background = self._field[0].appearance.background_color().detach().cpu().numpy()
        for k, (camera, depth) in enumerate(zip(self._photographs, self._depths, strict=True)):
            if not np.isfinite(depth).all():
                (image,) = load_views(folder, [camera])
                self._depths[k] = without_misses(depth, image, background)

    def _depths_of(self, cameras: Sequence[Camera]) -> list[Depth]:
        radiance, space, device = self._field
        renders = rendered(radiance, space, cameras, _DEPTH_ALONE, device)
        return [one.median_depth.numpy() for one in renders]


def without_misses(depth: Depth, photograph: Image, background: Float[np.ndarray, " 3"]) -> Depth:
    """Returns the depth with 0 where nothing is hit, but the photograph shows something.

    The photograph shows something where a third of the pixels about one hit nothing in the field,
    and have another color than `background` in the photograph. Masked pixels have none.

    Args:
        depth: The depth of the field; infinite where nothing is hit.
        photograph: The photograph, at the same size.
        background: The color of the background, RGB in [0, 1].
    """
    empty = ~np.isfinite(depth)
    pixels = photograph.numpy()
    apart = np.sqrt(np.square(pixels[..., :3] / 255 - background).mean(axis=-1))
    differs = empty & (apart > _SAME_COLOR) & (pixels[..., 3:] == 255).all(axis=-1)  # if masked
    around = cv2.blur(differs.astype(np.float64), (_AROUND_PX, _AROUND_PX))
    return np.where(empty & (around > _MANY), 0.0, depth)


def photographs_seeing(
    camera: Camera,
    depth: Depth,
    photographs: Sequence[Camera],
    depths: Sequence[Depth],
    config: SupportConfig,
) -> Int[np.ndarray, " pixels"]:
    """Returns how many photographs see the point that each pixel of a camera shows, row by row.

    Args:
        camera: The camera of the pixels.
        depth: Its depth Z; infinite where nothing is hit.
        photographs: The cameras of the photographs.
        depths: The depths of the photographs; 0 where they show something that the field lacks.
        config: The tolerances within which surfaces are the same.
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
    is_known = found > 0
    same = np.abs(1 / np.where(is_known, found, 1.0) - 1 / safe) <= slack
    visible: Bool[np.ndarray, " points"] = inside & is_known & (same if baseline > 0 else True)
    return visible
