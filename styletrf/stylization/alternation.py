"""The views that the next round paints, where painting and adapting alternate."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import torch

from styletrf.field.radiance_field import load_stylized_field
from styletrf.field.rendering import RenderConfig
from styletrf.files.float_images import FloatImage
from styletrf.geometry.cameras import Camera
from styletrf.scene.scene_model import read_scene_model
from styletrf.trajectory.frames import rendered


def blend_with_previous_round(
    unstylized: Sequence[FloatImage],
    cameras: Sequence[Camera],
    inputs: Mapping[str, Path],
    device: torch.device,
) -> list[FloatImage]:
    """Returns the mean of unstylized views and of renders of the field of the round before.

    The unstylized half keeps the objects; the other brings the strokes that all views agree on.

    Args:
        unstylized: The prior renders.
        cameras: The cameras of the renders.
        inputs: Folders: `field`, `before` (of the round before) and `model`.
        device: The device that renders.
    """
    renders = rendered(
        load_stylized_field(inputs["field"], inputs["before"]),
        read_scene_model(inputs["model"] / "scene.json").space,
        cameras, RenderConfig(), device,
    )  # fmt: skip
    pairs = zip(unstylized, renders, strict=True)
    return [replace(a, color=(a.color + r.color.numpy()) / 2) for a, r in pairs]
