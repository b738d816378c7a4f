"""Bakes fields that share a density into values at lattice points.

Raw densities and plain colors are exact there but for their quantization; colors that depend on the
view are fitted (`color_refit`). The loss of pictures by baking is measured in dB.
"""

from bisect import bisect_left
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from styletrf.errors import InputError
from styletrf.field.radiance_field import RadianceField
from styletrf.field.shading import DiffuseColor
from styletrf.field.tensor_vm import LINE_AXES, PLANE_AXES, TensorVM
from styletrf.viewer.baked_appearance import BakedAppearance
from styletrf.viewer.baking_loss import baking_loss, loss_against, own_pictures
from styletrf.viewer.coding import (
    FINEST,
    Codes,
    Spacings,
    color_codes,
    density_codes,
    shown_colors,
    slope_codes,
    spacings_of,
)
from styletrf.viewer.color_refit import RefitConfig, refitted_colors
from styletrf.viewer.lattice import MOST_BRICKS, BrickLattice, empty_distances
from styletrf.viewer.point_effects import Classes
from styletrf.viewer.seen_points import SeenPoints, lattice_within
from styletrf.viewer.view_directions import ViewDirections
from styletrf.viewer.visibility import Views

_CHUNK = 1 << 17
_FINEST_SPACINGS = tuple(8 / 2 ** (k / 4) for k in range(29))
"""Values for `spacings_of`, from 8 to 1/16; the first is taken with which the worst of some
pictures loses at most _MOST_LOSS_DB, or has _ENOUGH_DB."""
_MOST_LOSS_DB, _ENOUGH_DB = 0.2, 45.5


@dataclass(frozen=True, slots=True)
class BakedDensity:
    """Raw densities at lattice points, and where they may be more than nothing.

    Attributes:
        lattice: The lattice of the points.
        codes: The codes of the raw densities.
        distances: The `empty_distances` of the field's own occupancy grid.
        shift: See `Density`.
        scale: See `Density`.
        reduced_from: The points of the field's lattice, where that had too many.
        psnr_db: The PSNR of pictures with the coarser lattice against those with the field's own.
    """

    lattice: BrickLattice
    codes: Codes
    distances: UInt8[np.ndarray, "x y z"]
    shift: float
    scale: float
    reduced_from: tuple[int, int, int] | None = None
    psnr_db: float = 100.0


@dataclass(frozen=True, slots=True)
class BakedLook:
    """The colors of one appearance.

    Attributes:
        name: The name of the painting, or of the photographs.
        lattice: The lattice of the points.
        codes: The codes of the colors before their sigmoid.
        classes: The classes of the points, see `styletrf.viewer.point_effects`.
        spacings: The spacings of the codes and slopes in each class, see `styletrf.viewer.coding`.
        slope_codes: The codes of the slopes; None if colors do not change with the direction.
        directions: The axes that turn directions, and the tint; None if there are no slopes.
        weight_power: See `styletrf.field.weight_sharpening`.
        background: The color behind everything.
        psnr_db: The PSNR of pictures with these colors against those with the appearance's own.
        reduced_from: The points of the appearance's lattice, where that had too many.
    """

    name: str
    lattice: BrickLattice
    codes: Codes
    classes: Classes
    spacings: Spacings
    slope_codes: Codes | None
    directions: ViewDirections | None
    weight_power: float
    background: tuple[float, float, float]
    psnr_db: float
    reduced_from: tuple[int, int, int] | None

    def appearance(self) -> BakedAppearance:
        """Returns the appearance that the viewer shows."""
        base, slope = self._shown(self.codes), None
        if self.slope_codes is not None:
            slope = self._shown(self.slope_codes)
        background, directions = torch.tensor(self.background), self.directions
        return BakedAppearance(self.lattice, base, self.weight_power, background, slope, directions)

    def _shown(self, codes: Codes) -> Float[np.ndarray, "points 3"]:
        return shown_colors(codes, self.classes, self.spacings).values()


def bake_density(
    field: RadianceField, views: Views, most_bricks: int = MOST_BRICKS
) -> BakedDensity:
    """Returns the density of a field, on a coarser lattice where its own has too many bricks.

    Args:
        field: The field whose density it is.
        views: The views by which the loss of a coarser lattice is measured.
        most_bricks: The most bricks of the lattice.
    """
    density = field.density
    occupancy, own = density.occupancy.numpy(), density.factors
    factors, lattice = lattice_within(own, occupancy, most_bricks)
    values = lattice_values(factors, lattice)
    codes, distances = density_codes(values, lattice.needed.ravel()), empty_distances(occupancy)
    baked = BakedDensity(lattice, codes, distances, density.shift, density.scale)
    if factors is own:
        return baked
    loss = baking_loss(field, views, density=factors)
    return replace(baked, reduced_from=own.resolution, psnr_db=loss.mean_db)


def bake_look(
    name: str,
    field: RadianceField,
    views: Views,
    seen: SeenPoints,
    refit: RefitConfig,
) -> BakedLook:
    """Returns the colors of a field.

    Args:
        name: The name to show.
        field: The field whose appearance it is.
        views: The views that see it.
        seen: The points that are to have colors.
        refit: The settings of the fit of colors that depend on the view.
    """
    appearance = field.appearance
    lattice, colors, slopes, directions = _colors(field, views, seen, refit)
    own = appearance.factors.resolution
    red, green, blue = appearance.background_color().detach().tolist()
    look = BakedLook(
        name, lattice, colors, seen.classes(field, views, lattice), FINEST, slopes, directions,
        appearance.weight_power, (red, green, blue), 100.0,
        own if max(lattice.resolution) < max(own) else None,
    )  # fmt: skip
    return _coarsened(look, field, views)


def _colors(
    field: RadianceField, views: Views, seen: SeenPoints, refit: RefitConfig
) -> tuple[BrickLattice, Codes, Codes | None, ViewDirections | None]:
    """Returns the colors of points, and their slopes where they depend on the view."""
    own, shading = field.appearance.factors, field.appearance.shading
    if isinstance(shading, DiffuseColor):
        factors, lattice = seen.within(own)
        values = lattice_values(factors, lattice, shading.basis.weight.detach())
        return lattice, color_codes(values, lattice.needed.ravel()), None, None
    lattice = seen.lattice(seen.finer(own.resolution))
    fitted = refitted_colors(field, views, lattice, refit)
    colors = color_codes(fitted.base, lattice.needed.ravel())
    return lattice, colors, slope_codes(fitted.slope, colors.step), fitted.directions


def _coarsened(look: BakedLook, field: RadianceField, views: Views) -> BakedLook:
    """Returns a look with the widest spacings with which pictures lose little."""
    own = own_pictures(field, views)

    @cache
    def with_spacings(spacings: Spacings) -> tuple[float, BakedLook]:
        coarse = replace(look, spacings=spacings)
        loss = loss_against(own, field, views, coarse.appearance())
        return loss.least_db, replace(coarse, psnr_db=loss.mean_db)

    enough_db = min(with_spacings(FINEST)[0] - _MOST_LOSS_DB, _ENOUGH_DB)
    ways = (*map(spacings_of, _FINEST_SPACINGS), FINEST)
    first = bisect_left(ways, enough_db, key=lambda spacings: with_spacings(spacings)[0])
    return with_spacings(ways[first])[1]


def require_shared_density(name: str, field: RadianceField, other: RadianceField) -> None:
    """Refuses a field whose density is not that of the other.

    Raises:
        InputError: Its painting was made with the strategies s1 or s2.
    """
    ours, theirs = field.density.state_dict(), other.density.state_dict()
    if any(not torch.equal(ours[key], theirs[key]) for key in ours):
        problem = "has a geometry of its own, and the viewer shows all paintings on one"
        raise InputError(f"style {name}", problem, "Make it with --strategy s3")


def lattice_values(
    factors: TensorVM,
    lattice: BrickLattice,
    basis: Float[Tensor, "channels components"] | None = None,
) -> Float[np.ndarray, "points channels"]:
    """Returns the sum of the components at the stored points, or their product with `basis`.

    At a lattice point neither plane nor line is interpolated.
    """
    parts = []
    for chunk in torch.from_numpy(lattice.points()).split(_CHUNK):
        columns = [
            plane[chunk[:, v], chunk[:, u]] * line[chunk[:, w]]
            for (u, v), w, plane, line in zip(
                PLANE_AXES, LINE_AXES, factors.planes, factors.lines, strict=True
            )
        ]
        components = torch.cat(columns, dim=1).detach()
        parts.append(components.sum(1, keepdim=True) if basis is None else components @ basis.T)
    values: Float[np.ndarray, "points channels"] = torch.cat(parts).numpy()
    return values
