"""Photographs of the courtyard with their true cameras and depths."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from styletrf.errors import InputError
from styletrf.geometry.cameras import Camera
from styletrf.progress import Progress, silent
from styletrf.synthetic.courtyard.lit_scene import lit_courtyard
from styletrf.synthetic.courtyard.paths import forward_poses, orbit_poses, walk_poses
from styletrf.synthetic.courtyard.rays import in_threads
from styletrf.synthetic.courtyard.render import developed, render_linear
from styletrf.synthetic.courtyard.shading import Surfaces

_PATHS = {"forward": forward_poses, "orbit": orbit_poses, "walk": walk_poses}
KINDS = tuple(_PATHS)


@dataclass(frozen=True, slots=True)
class CourtyardConfig:
    """Settings of a capture: `kind` is one of KINDS; without `glossy` the vase is absent.

    A walk sees more than the courtyard: houses beyond its walls, and hills.
    """

    kind: str = "forward"
    n_views: int = 30
    width: int = 400
    height: int = 300
    glossy: bool = True
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Capture:
    """Photographs (sRGB) and, for each pixel center, depth Z in meters, infinite in the sky."""

    cameras: list[Camera]
    images: list[UInt8[np.ndarray, "height width 3"]]
    depths: list[Float[np.ndarray, "height width"]]


def courtyard_cameras(config: CourtyardConfig) -> list[Camera]:
    """Returns the exact cameras of a capture, their names in the order of the file names.

    Raises:
        InputError: The kind is unknown, or there are no views or no pixels.
    """
    if config.kind not in _PATHS:
        raise InputError(f"kind {config.kind!r}", "is unknown", f"Choose one of {', '.join(KINDS)}")
    if min(config.n_views, config.width, config.height) < 1:
        raise InputError("the capture", "has no views or no pixels", "Ask for at least one of each")
    rng = np.random.default_rng([config.seed, 30])
    focal = 0.85 * max(config.width, config.height)
    return [
        Camera(
            name=f"{index:03d}.png",
            width=config.width,
            height=config.height,
            fx=focal,
            fy=focal,
            cx=config.width / 2,
            cy=config.height / 2,
            world_from_camera=pose,
        )
        for index, pose in enumerate(_PATHS[config.kind](config.n_views, rng))
    ]


def render_view(
    camera: Camera, config: CourtyardConfig
) -> tuple[UInt8[np.ndarray, "height width 3"], Float[np.ndarray, "height width"]]:
    """Returns the photograph and the depth Z of a camera anywhere in the configured courtyard.

    The size is the camera's; of the configuration, seed, gloss and kind matter.
    """
    light, depth = render_linear(lit_scene(config), camera)
    return developed(light), depth.astype(np.float32)


def lit_scene(config: CourtyardConfig) -> Surfaces:
    """Returns the configured courtyard with its daylight, ready for rays."""
    return lit_courtyard(config.seed, glossy=config.glossy, surround=config.kind == "walk")


def capture_courtyard(config: CourtyardConfig, progress: Progress = silent) -> Capture:
    """Returns the photographs of a capture, the same for the same configuration."""
    cameras = courtyard_cameras(config)
    lit_scene(config)
    views = []
    for view in in_threads(lambda camera: render_view(camera, config), cameras):
        views.append(view)
        progress(len(views), len(cameras))
    images, depths = zip(*views, strict=True)
    return Capture(cameras, list(images), list(depths))
