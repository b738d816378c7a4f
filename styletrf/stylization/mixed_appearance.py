"""Mixes several appearances of one density at their samples.

    color(x, d) = sum_k fraction_k(x) color_k(x, d),   sum_k fraction_k(x) = 1

The density is one. Where the appearances have one power, a ray's weights are one, too, and a
mixture with fractions that are the same everywhere renders exactly the mixture of the renders: a
weaker style, or two styles at once, need no training.
Within a region the fractions are those given, outside it all is the first appearance's.

Where they differ in the power of their weights (`styletrf.field.weight_sharpening`), a sample has
the mean of the powers by its fractions. So a single appearance and the outside of a region are
rendered exactly, and a mixture is as crisp as its parts.
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
    """Appearances mixed by their fractions; outside of the region, the first one alone."""

    def __init__(
        self,
        appearances: Sequence[Appearance],
        fractions: Sequence[float],
        region: Region | None = None,
        space: Space | None = None,
    ) -> None:
        """Combines the appearances.

        Args:
            appearances: The appearances, on one grid.
            fractions: The fraction of each, not negative; they sum to 1.
            region: The region in which the fractions hold; None is everywhere.
            space: The space of the grid, by which positions are found in the world; for a region.

        Raises:
            ValueError: The fractions are invalid, or a region comes without its space.
        """
        super().__init__()
        if (
            len(fractions) != len(appearances)
            or min(fractions) < 0
            or abs(sum(fractions) - 1) > 1e-6
        ):
            raise ValueError(f"fractions of {len(appearances)} appearances are {list(fractions)}")
        if region is not None and space is None:
            raise ValueError("a region needs the space of the grid")
        self.appearances = nn.ModuleList(appearances)
        self.register_buffer("fractions", torch.tensor(list(fractions)), persistent=False)
        self._region, self._space = region, space

    def weight_powers(self, positions: Tensor) -> float | Tensor:
        """Returns the mean of the powers by the fractions; the one power if all have the same."""
        powers = [appearance.weight_power for appearance in self._all()]
        if len(set(powers)) == 1:
            return powers[0]
        return self.fractions_at(positions) @ torch.tensor(powers).to(positions)

    def components(self, positions: Tensor, kernels: Kernels) -> Tensor:
        """Returns the components of all, and behind them the fractions."""
        parts = [a.components(positions, kernels) for a in self._all()]
        return torch.cat([*parts, self.fractions_at(positions)], dim=1)

    def decode(
        self, components: Tensor, view_directions: Tensor, ray: Tensor, kernels: Kernels
    ) -> Tensor:
        """Returns the sum of the colors, weighted by the fractions."""
        appearances = self._all()
        sizes = [sum(a.factors.ranks) for a in appearances]
        *parts, fractions = components.split([*sizes, len(appearances)], dim=1)
        colors = [
            a.decode(part.contiguous(), view_directions, ray, kernels)
            for a, part in zip(appearances, parts, strict=True)
        ]
        mixed: Tensor = (torch.stack(colors, dim=1) * fractions[..., None]).sum(dim=1)
        return mixed

    def background_color(self) -> Tensor:
        """Returns the mixture; with a region, the first appearance's: nothing is there to be in."""
        colors = torch.stack([a.background_color() for a in self._all()])
        mixed: Tensor = self.get_buffer("fractions") @ colors
        return mixed if self._region is None else colors[0]

    def fractions_at(self, positions: Float[Tensor, "samples 3"]) -> Float[Tensor, "samples parts"]:
        """Returns the fractions of all appearances at positions in the grid."""
        fractions = self.get_buffer("fractions").expand(len(positions), -1)
        if self._region is None or self._space is None:
            return fractions
        points = self._space.to_world(positions.detach().cpu().numpy().astype(np.float64))
        inside = torch.from_numpy(self._region.inside(points)).to(positions)[:, None]
        first = torch.zeros_like(fractions)
        first[:, 0] = 1
        return torch.lerp(first, fractions, inside)

    def _all(self) -> list[Appearance]:
        return [a for a in self.appearances if isinstance(a, Appearance)]
