"""The size of a field, named as TensoRF names it."""

from dataclasses import dataclass, replace

from styletrf.configuration import require_at_least
from styletrf.field.shading import ShadingKind


@dataclass(frozen=True, slots=True)
class FieldConfig:
    """The size of a field; names in brackets are TensoRF's.

    Ranks are per axis pair xy, xz, yz [n_lamb_sigma, n_lamb_sh]; one alone is that of the first
    pair, and the space decides the others', see `in_space`.
    """

    density_ranks: tuple[int, ...] = (16,)
    appearance_ranks: tuple[int, ...] = (24,)
    features: int = 27  # [data_dim_color]
    hidden: int = 64  # [featureC]
    shading: ShadingKind = "network"  # [shadingMode]: MLP_Fea without encodings, or RGB
    density_shift: float = -7.0  # [density_shift]: no raw density is empty space
    density_scale: float = 25.0  # [distance_scale]
    initial_raw_density: float = 3.0  # a thin fog that light gets through and gradients see

    def __post_init__(self) -> None:
        for ranks in (self.density_ranks, self.appearance_ranks):
            if len(ranks) not in (1, 3) or not all(rank > 0 for rank in ranks):
                raise ValueError(f"ranks are {ranks}, not one or three positive numbers")
        require_at_least(1, self, "features", "hidden")
        require_at_least(0, self, "initial_raw_density")

    def in_space(self, kind: str) -> "FieldConfig":
        """Returns the configuration with a rank for every axis pair.

        In NDC, which is looked at along z, the pairs with z get a quarter of the density's ranks
        (as in TensoRF's settings for such scenes) and half of the appearance's. The axes of a box
        are alike.
        """
        of_density, of_appearance = (4, 2) if kind == "ndc" else (1, 1)

        def spread(ranks: tuple[int, ...], divisor: int) -> tuple[int, ...]:
            others = max(1, ranks[0] // divisor)
            return ranks if len(ranks) == 3 else (ranks[0], others, others)

        return replace(
            self,
            density_ranks=spread(self.density_ranks, of_density),
            appearance_ranks=spread(self.appearance_ranks, of_appearance),
        )
