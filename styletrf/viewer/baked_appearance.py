"""An appearance given by colors at lattice points, as the viewer shows it."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.field.appearance import ColorModel
from styletrf.field.kernels import Kernels
from styletrf.viewer import lattice_kernels
from styletrf.viewer.lattice import BrickLattice


class BakedAppearance(ColorModel):
    """color(x, d) = sigmoid(base(x) + slope(x) . (d - mean direction)), both trilinear.

    Without slopes it is the same from everywhere.
    """

    def __init__(
        self,
        lattice: BrickLattice,
        values: Float[np.ndarray, "points 3"],
        weight_power: float,
        background: Float[Tensor, " 3"],
        slope: Float[np.ndarray, "points 3"] | None = None,
        mean_direction: Float[np.ndarray, " 3"] | None = None,
    ) -> None:
        """Takes what is shown.

        Args:
            lattice: Of the points.
            values: Colors before their sigmoid.
            weight_power: See `styletrf.field.weight_sharpening`.
            background: The color behind everything, in [0, 1].
            slope: How all channels change with the direction; see `color_refit`.
            mean_direction: From which directions are counted, where there are slopes.
        """
        super().__init__()
        self._lattice = lattice
        self._values = values if slope is None else np.concatenate([values, slope], axis=1)
        self._mean = None if slope is None else torch.as_tensor(mean_direction)
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
        if self._mean is None:
            return torch.sigmoid(base)
        turned = view_directions[ray] - self._mean
        return torch.sigmoid(base + (slope * turned).sum(dim=1, keepdim=True))

    def background_color(self) -> Tensor:
        """Returns the color behind everything."""
        return self._background
