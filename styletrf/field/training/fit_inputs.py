"""The inputs of a fit: views with their colors and depths, and the volume that the field fills."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from jaxtyping import Bool
from torch import Tensor

from styletrf.capture.view_images import Image
from styletrf.field.training.observed_depths import ObservedDepths
from styletrf.field.training.view_exposures import ViewExposures
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space


@dataclass(frozen=True, slots=True)
class TrainingViews:
    """The views that a field is fitted to.

    Attributes:
        cameras: Their cameras, in the normalized world.
        images: The images of the cameras, in their order; read once.
        depths: The depths at which the rays of some pixels end
            (`styletrf.field.training.observed_depths`).
        exposures: The exposures of the views, where these differ
            (`styletrf.field.training.view_exposures`).
    """

    cameras: Sequence[Camera]
    images: Iterable[Image]
    depths: ObservedDepths | None = None
    exposures: ViewExposures | None = None


@dataclass(frozen=True, slots=True)
class FieldVolume:
    """The volume that a field fills.

    Attributes:
        space: The map from the normalized world to the grid.
        resolution: The final number of lattice points along each axis.
        free: The cells of the grid that get no density (`styletrf.scene.free_space`).
    """

    space: Space
    resolution: tuple[int, int, int]
    free: Bool[Tensor, "cells cells cells"] | None = None
