"""Several appearances of one density, mixed where their samples are.

    color(x, d) = sum_k share_k(x) color_k(x, d),   sum_k share_k(x) = 1

The density is one. Where the appearances have one power, a ray's weights are one, too, and a
mixture with shares that are the same everywhere renders exactly the mixture of the renders: a
weaker style, or two styles at once, need no training.
Within a region the shares are those given, outside it all is the first appearance's.

Where they differ in the power of their weights (`styletrf.field.weight_sharpening`), a sample has
the mean of the powers by its shares. So a single appearance and the outside of a region are
rendered exactly, and what lies between is as crisp as its parts.
"""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from styletrf.field.appearance import Appearance, ColorModel
from styletrf.field.kernels import Kernels
from styletrf.geometry.space import Space
from styletrf.stylization.region import Region


class MixedAppearance(ColorModel):
    """Appearances by their shares; the first is what remains outside of the region."""

    def __init__(
        self,
        appearances: Sequence[Appearance],
        shares: Sequence[float],
        region: Region | None = None,
        space: Space | None = None,
    ) -> None:
        """Mixes.

        Args:
            appearances: On one grid.
            shares: Of each, not negative; they sum to 1.
            region: Where the shares hold; None is everywhere.
            space: Of the grid, by which positions are found in the world; for a region.

        Raises:
            ValueError: The shares are not such, or a region comes without its space.
        """
        super().__init__()
        if len(shares) != len(appearances) or min(shares) < 0 or abs(sum(shares) - 1) > 1e-6:
            raise ValueError(f"shares of {len(appearances)} appearances are {list(shares)}")
        if region is not None and space is None:
            raise ValueError("a region needs the space of the grid")
        self.appearances = nn.ModuleList(appearances)
        self.register_buffer("shares", torch.tensor(list(shares)), persistent=False)
        self._region, self._space = region, space

    def weight_powers(self, positions: Tensor) -> Tensor:
        """Returns the mean of the powers by the shares."""
        powers = [appearance.weight_power for appearance in self._all()]
        return self.shares_at(positions) @ torch.tensor(powers).to(positions)

    def components(self, positions: Tensor, kernels: Kernels) -> Tensor:
        """Returns the components of all, and behind them the shares."""
        parts = [a.components(positions, kernels) for a in self._all()]
        return torch.cat([*parts, self.shares_at(positions)], dim=1)

    def decode(
        self, components: Tensor, view_directions: Tensor, ray: Tensor, kernels: Kernels
    ) -> Tensor:
        """Returns the shares' sum of the colors."""
        appearances = self._all()
        sizes = [sum(a.factors.ranks) for a in appearances]
        *parts, shares = components.split([*sizes, len(appearances)], dim=1)
        colors = [
            a.decode(part.contiguous(), view_directions, ray, kernels)
            for a, part in zip(appearances, parts, strict=True)
        ]
        mixed: Tensor = (torch.stack(colors, dim=1) * shares[..., None]).sum(dim=1)
        return mixed

    def background_color(self) -> Tensor:
        """Returns the mixture; with a region, the first appearance's: nothing is there to be in."""
        colors = torch.stack([a.background_color() for a in self._all()])
        mixed: Tensor = self.get_buffer("shares") @ colors
        return mixed if self._region is None else colors[0]

    def shares_at(self, positions: Float[Tensor, "samples 3"]) -> Float[Tensor, "samples parts"]:
        """Returns the shares of all appearances at positions in the grid."""
        shares = self.get_buffer("shares").expand(len(positions), -1)
        if self._region is None or self._space is None:
            return shares
        points = self._space.to_world(positions.detach().cpu().numpy().astype(np.float64))
        inside = torch.from_numpy(self._region.share(points)).to(positions)[:, None]
        first = torch.zeros_like(shares)
        first[:, 0] = 1
        return torch.lerp(first, shares, inside)

    def _all(self) -> list[Appearance]:
        return [a for a in self.appearances if isinstance(a, Appearance)]
