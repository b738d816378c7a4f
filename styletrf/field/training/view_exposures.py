"""The exposures of the views that a field is fitted to, so that the field has the middle one.

The field's colors are shown as each photograph was exposed (`styletrf.scene.exposures`), and
compared there: a saturated pixel of a photograph says only that the color is at least so bright.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.geometry.cameras import Camera
from styletrf.scene.exposures import MIDDLE, Exposure

_DARKEST = 1 / 512  # a power has no finite gradient at 0
_SATURATED = 1 - 1 / 512


@dataclass(frozen=True, slots=True)
class ViewExposures:
    """The log gain and the power of each view and channel, on the device of the fit."""

    log_gain: Float[Tensor, "views 3"]
    power: Float[Tensor, "views 3"]

    def shown(
        self,
        color: Float[Tensor, "rays 3"],
        view: Int64[Tensor, " rays"],
        photographed: Float[Tensor, "rays 3"],
    ) -> Float[Tensor, "rays 3"]:
        """Returns MIDDLE (color / MIDDLE)^power gain, at most 1 where the photograph is saturated.

        Differentiable in the color; below _DARKEST the curve continues as the line to black.

        Args:
            color: The colors of the field, in [0, 1].
            view: The view whose exposure each is to have.
            photographed: The photographs' colors in [0, 1].
        """
        scaled = color.clamp(min=_DARKEST) / MIDDLE
        exposed = MIDDLE * self.log_gain[view].exp() * scaled ** self.power[view]
        exposed = exposed * (color / _DARKEST).clamp(max=1)
        return torch.where(photographed < _SATURATED, exposed, exposed.clamp(max=1))


def view_exposures(
    cameras: Sequence[Camera], exposures: Mapping[str, Exposure], device: torch.device
) -> ViewExposures | None:
    """Returns the exposures of the cameras' photographs; None where all have the same."""
    if not exposures:
        return None
    of_views = [exposures[camera.name] for camera in cameras]
    log_gain = torch.tensor([exposure.log_gain for exposure in of_views], device=device)
    return ViewExposures(
        log_gain, torch.tensor([exposure.power for exposure in of_views], device=device)
    )
