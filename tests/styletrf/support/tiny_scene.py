"""Small fields of the courtyard in all three spaces, each with two styles on its density."""

from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import torch
from shared_results import made_once

KINDS = {"ndc": "forward", "box": "orbit", "unbounded": "orbit"}


@dataclass(frozen=True)
class TinyScene:
    """A field as photographed, and two styles of it, the second with sharper weights."""

    cameras: list
    model: object
    fields: dict


@cache
def tiny_scene(space: str) -> TinyScene:
    """Returns the scene in a space, made once in a run."""
    return made_once(f"tiny scene in {space}", lambda: _made(space))


def _made(space: str, views: int = 6, width: int = 48) -> TinyScene:
    from mini_scene import KERNELS, MINI_FIT

    from styletrf.field.training.field_training import train_field
    from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
    from styletrf.geometry.cameras import pixel_centers, points_at_depth
    from styletrf.scene.scene_model import SceneModelConfig, decide_scene_model
    from styletrf.synthetic.courtyard.capture import CourtyardConfig, capture_courtyard

    capture = capture_courtyard(CourtyardConfig(KINDS[space], views, width, width * 3 // 4))
    points = []
    for camera, depth in zip(capture.cameras, capture.depths, strict=True):
        seen = np.isfinite(depth.ravel())
        pixels = pixel_centers(camera.width, camera.height)[seen][::7]
        points.append(points_at_depth(camera, pixels, depth.ravel()[seen][::7]))
    config = SceneModelConfig(space=space, image_long_side=width, max_voxels=32**3)
    model = decide_scene_model(capture.cameras, np.concatenate(points), config)
    cameras = model.normalized(capture.cameras)
    fit = replace(MINI_FIT, iterations=60, upsample_at=(0.5,))
    images = torch.from_numpy(np.stack(capture.images))
    volume = FieldVolume(model.space, model.resolution)
    field, _ = train_field(TrainingViews(cameras, images), volume, fit, KERNELS)
    styles = {f"style {k}": styled(field, k) for k in (1, 2)}
    return TinyScene(cameras, model, {"Photographs": field, **styles})


def styled(field, seed: int):
    """A style that nothing was fitted to: other colors, on a finer lattice."""
    from styletrf.field.radiance_field import refine_appearance

    style, generator = deepcopy(field), torch.Generator().manual_seed(seed)
    refine_appearance(style, 1.5, "plain", generator)
    style.appearance.weight_power = float(seed)
    style.appearance.background = torch.nn.Parameter(torch.randn(3, generator=generator))
    with torch.no_grad():
        style.appearance.shading.basis.weight *= 4
    return style
