"""An appearance given by colors at lattice points, as the viewer shows it."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import Kernels
from styletrf.viewer import lattice_kernels
from styletrf.viewer.lattice import BrickLattice
from styletrf.viewer.view_directions import ViewDirections


class BakedAppearance(ColorModel):
    """color(x, d) = sigmoid(base(x) + slope(x) . t(d) + tint(d)), base and slope trilinear.

    For t and tint see `ViewDirections`. Without slopes it is the same from everywhere.
    """

    def __init__(
        self,
        lattice: BrickLattice,
        values: Float[np.ndarray, "points 3"],
        weight_power: float,
        background: Float[Tensor, " 3"],
        slope: Float[np.ndarray, "points 3"] | None = None,
        directions: ViewDirections | None = None,
    ) -> None:
        """Takes the values of the appearance.

        Args:
            lattice: The lattice of the points.
            values: The colors before their sigmoid.
            weight_power: See `styletrf.field.weight_sharpening`.
            background: The color behind everything, in [0, 1].
            slope: The change of all channels with the direction; see `color_refit`.
            directions: The axes that turn directions, and the tint, where there are slopes.
        """
        super().__init__()
        self._lattice = lattice
        self._values = values if slope is None else np.concatenate([values, slope], axis=1)
        self._directions = directions
        self.weight_power, self._background = weight_power, background

    def weight_powers(self, positions: Tensor) -> float:  # noqa: ARG002
        """Returns the one power."""
        return self.weight_power

    def components(self, positions: Tensor, kernels: Kernels) -> Tensor:  # noqa: ARG002
        """Returns the interpolated values; points that are not stored count as 0."""
        low, rest = self._lattice.cells(positions.numpy())
        rest = rest.astype(np.float32)
        found = lattice_kernels.interpolated(self._lattice.slots, low, rest, self._values)
        return torch.from_numpy(found)

    def decode(
        self,
        components: Tensor,
        view_directions: Tensor,
        ray: Tensor,
        kernels: Kernels,  # noqa: ARG002
    ) -> Tensor:
        """Returns the colors."""
        base, slope = components[:, :3], components[:, 3:]
        if self._directions is None:
            return torch.sigmoid(base)
        of_rays = self._directions.turned(view_directions.numpy())
        turned = torch.from_numpy(of_rays)[ray]
        tints = torch.from_numpy(self._directions.tints(of_rays))[ray]
        return torch.sigmoid(base + (slope * turned).sum(dim=1, keepdim=True) + tints)

    def background_color(self) -> Tensor:
        """Returns the color behind everything."""
        return self._background
