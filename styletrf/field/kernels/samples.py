"""The inputs and the outputs of the kernels."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor

from styletrf.field.kernels.sparsification import Sparsification

MAX_OPTICAL_THICKNESS = 1e30


@dataclass(frozen=True, slots=True)
class RaySegments:
    """Rays as chains of straight pieces of the grid, by s in [0, 1], the fraction of their length.

    A piece is `origin + s * direction` for s up to its end, where the next begins; the last ends at
    1, and so do pieces that a ray has less than others. `lengths` is the optical length of the
    whole ray, `n_steps` into how many steps it is cut (0 for one that misses the grid).
    `depth_near`, `depth_far` and `depth_bend` give the depth Z of a point (see `depth_along`).
    """

    origins: Float[Tensor, "rays pieces 3"]
    directions: Float[Tensor, "rays pieces 3"]
    ends: Float[Tensor, "rays pieces"]
    lengths: Float[Tensor, " rays"]
    n_steps: Int64[Tensor, " rays"]
    view_directions: Float[Tensor, "rays 3"]
    depth_near: Float[Tensor, "rays pieces"]
    depth_far: Float[Tensor, "rays pieces"]
    depth_bend: Float[Tensor, "rays pieces"]

    def __getitem__(self, rays: slice | Tensor) -> "RaySegments":
        """Returns some of the segments."""
        return RaySegments(*(getattr(self, name)[rays] for name in self.__slots__))

    def __len__(self) -> int:
        return self.origins.shape[0]

    def step_thickness(self, scale: float) -> Float[Tensor, " rays"]:
        """Returns the optical thickness of one step of each ray per softplus(raw + shift).

        It, its length and `scale` saturate at MAX_OPTICAL_THICKNESS: 0 times an infinite one is 0,
        and its gradients do not overflow.
        """
        step_lengths = self.lengths.clamp(max=MAX_OPTICAL_THICKNESS) / self.n_steps.clamp(min=1)
        return (step_lengths * min(scale, MAX_OPTICAL_THICKNESS)).clamp(max=MAX_OPTICAL_THICKNESS)

    def piece_at(
        self, ray: Int64[Tensor, " samples"], s: Float[Tensor, " samples"]
    ) -> Int64[Tensor, " samples"]:
        """Returns which piece of its ray each s lies on."""
        if self.ends.shape[1] == 1:
            return torch.zeros_like(ray)
        return (s[:, None] > self.ends[:, :-1][ray]).sum(dim=1)

    def positions_at(
        self, ray: Int64[Tensor, " samples"], s: Float[Tensor, " samples"]
    ) -> Float[Tensor, "samples 3"]:
        """Returns the grid positions at s."""
        piece = self.piece_at(ray, s)
        return self.origins[ray, piece] + s[:, None] * self.directions[ray, piece]

    def depth_along(
        self, ray: Int64[Tensor, " samples"], s: Float[Tensor, " samples"]
    ) -> Float[Tensor, " samples"]:
        """Returns the depth Z at s, perspective-correct.

        With u the fraction of its piece before s, Z is linear in t = u / (u + (1 - u) bend).
        """
        piece = self.piece_at(ray, s)
        at = ray * self.ends.shape[1] + piece
        near, far, bend, ends = (
            values.reshape(-1)[at]
            for values in (self.depth_near, self.depth_far, self.depth_bend, self.ends)
        )
        starts = torch.where(piece > 0, self.ends.reshape(-1)[at - 1], 0.0)
        fraction = ends - starts
        u = torch.where(fraction > 0, (s - starts) / fraction, 0.0)
        t = u / (u + (1 - u) * bend)
        return near + t * (far - near)


@dataclass(frozen=True, slots=True)
class March:
    """Settings of the sampling of rays: density = scale x softplus(raw + shift); see `trace`.

    `sparsification` is that of the raw densities' gradient.
    """

    occupancy: UInt8[Tensor, "x y z"]
    shift: float
    scale: float
    termination: float
    sparsification: Sparsification | None = None


@dataclass(frozen=True, slots=True)
class Samples:
    """Samples of a bundle of rays, packed ray after ray; only `weights` carries a gradient."""

    offsets: Int64[Tensor, " rays_and_one"]
    ray: Int64[Tensor, " samples"]
    s: Float[Tensor, " samples"]
    positions: Float[Tensor, "samples 3"]
    weights: Float[Tensor, " samples"]

    def sums_before(
        self, values: Float[Tensor, " samples"], at: Int64[Tensor, " some"] | slice = slice(None)
    ) -> Float[Tensor, " some"]:
        """Returns, of each sample, the float64 sum of the values of its ray's samples before it.

        The sums are those of the samples `at` some indices alone, where these are given.
        """
        sums = values.double().cumsum(0)
        sums = torch.cat([sums.new_zeros(1), sums])
        return sums[:-1][at] - sums[self.offsets[self.ray[at]]]

    def reached(self, sums: Float[Tensor, " rays"]) -> Int64[Tensor, " rays"]:
        """Returns the sample at which each ray's weights have summed to so much, above 0.

        Where they never do, the index is the one after the ray's last sample. The sums are in
        float64.
        """
        total = self.weights.double().cumsum(0)
        total = torch.cat([total.new_zeros(1), total])
        first, end = self.offsets[:-1], self.offsets[1:]
        index = torch.searchsorted(total[1:], total[first] + sums)
        return torch.minimum(torch.maximum(index, first), end)

    def chosen(
        self, offsets: Int64[Tensor, " rays_and_one"], index: Int64[Tensor, " kept"]
    ) -> "Samples":
        """Returns some of the samples, in their order; `offsets` says where their rays begin."""
        return Samples(
            offsets, self.ray[index], self.s[index], self.positions[index], self.weights[index]
        )
