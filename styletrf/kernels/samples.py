"""What goes into and comes out of the kernels."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from styletrf.kernels.thinning import Thinning

THICKEST = 1e30


@dataclass(frozen=True, slots=True)
class Segments:
    """Rays as segments `origin + s * direction`, s in [0, 1], of the grid.

    `lengths` is the optical length of the whole segment, `n_steps` into how many steps it is cut
    (0 for a ray that misses the grid). `depth_near`, `depth_far` and `depth_bend` give the depth Z
    of a point of the segment (see `depth_along`).
    """

    origins: Float[Tensor, "rays 3"]
    directions: Float[Tensor, "rays 3"]
    lengths: Float[Tensor, " rays"]
    n_steps: Int64[Tensor, " rays"]
    view_directions: Float[Tensor, "rays 3"]
    depth_near: Float[Tensor, " rays"]
    depth_far: Float[Tensor, " rays"]
    depth_bend: Float[Tensor, " rays"]

    def __getitem__(self, rays: slice | Tensor) -> "Segments":
        """Returns some of the segments."""
        return Segments(*(getattr(self, name)[rays] for name in self.__slots__))

    def __len__(self) -> int:
        return self.origins.shape[0]

    def step_thickness(self, scale: float) -> Float[Tensor, " rays"]:
        """Returns the optical thickness of one step of each ray per softplus(raw + shift).

        It, its length and `scale` saturate at THICKEST: 0 times an infinite one is 0, and its
        gradients do not overflow.
        """
        step_lengths = self.lengths.clamp(max=THICKEST) / self.n_steps.clamp(min=1)
        return (step_lengths * min(scale, THICKEST)).clamp(max=THICKEST)

    def depth_along(
        self, ray: Int64[Tensor, " samples"], s: Float[Tensor, " samples"]
    ) -> Float[Tensor, " samples"]:
        """Returns the depth Z at s, perspective-correct.

        Z is linear in t = s / (s + (1 - s) bend).
        """
        near, far, bend = self.depth_near[ray], self.depth_far[ray], self.depth_bend[ray]
        t = s / (s + (1 - s) * bend)
        return near + t * (far - near)


@dataclass(frozen=True, slots=True)
class March:
    """How rays are sampled: density = scale x softplus(raw + shift); see `trace`.

    `thinning` is that of the raw densities' gradient.
    """

    occupancy: UInt8[Tensor, "x y z"]
    shift: float
    scale: float
    termination: float
    thinning: Thinning | None = None


@dataclass(frozen=True, slots=True)
class Samples:
    """Samples of a bundle of rays, packed ray after ray; only `weights` carries a gradient."""

    offsets: Int64[Tensor, " rays_and_one"]
    ray: Int64[Tensor, " samples"]
    s: Float[Tensor, " samples"]
    positions: Float[Tensor, "samples 3"]
    weights: Float[Tensor, " samples"]

    def sums_before(self, values: Float[Tensor, " samples"]) -> Float[Tensor, " samples"]:
        """Returns, of each sample, the float64 sum of the values of its ray's samples before it."""
        sums = values.double().cumsum(0)
        sums = torch.cat([sums.new_zeros(1), sums])
        return sums[:-1] - sums[self.offsets[:-1]][self.ray]

    def chosen(
        self, offsets: Int64[Tensor, " rays_and_one"], index: Int64[Tensor, " kept"]
    ) -> "Samples":
        """Returns some of the samples, in their order; `offsets` says where their rays begin."""
        return Samples(
            offsets, self.ray[index], self.s[index], self.positions[index], self.weights[index]
        )
