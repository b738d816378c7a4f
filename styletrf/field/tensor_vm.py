"""Vector-matrix factors of a 3D tensor (TensoRF, Chen et al. 2022, eq. 3-5).

    T(x, y, z) = sum_k sum_c plane_k,c(u, v) * line_k,c(w)

over the three axis pairs k. Planes are channels-last `[v, u, c]`, lines `[w, c]`; lattice points
lie on grid coordinates -1 ... 1, the first and the last on the border.
"""

from collections.abc import Iterator, Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

PLANE_AXES = ((0, 1), (0, 2), (1, 2))  # (u, v): columns, rows
LINE_AXES = (2, 1, 0)
_IN_CACHE = 1 << 17  # numbers that a CPU's cache holds while several passes read them


class TensorVM(nn.Module):
    """The factors of one tensor; `ranks[k]` components for axis pair k."""

    def __init__(
        self,
        resolution: Sequence[int],
        ranks: Sequence[int],
        *,
        mean: float = 0.0,
        scale: float = 0.1,
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        planes, lines = [], []
        for (u, v), w, rank in zip(PLANE_AXES, LINE_AXES, ranks, strict=True):
            planes.append(torch.randn(resolution[v], resolution[u], rank, generator=generator))
            lines.append(torch.randn(resolution[w], rank, generator=generator))
        self.planes = nn.ParameterList([nn.Parameter(mean + scale * plane) for plane in planes])
        self.lines = nn.ParameterList([nn.Parameter(mean + scale * line) for line in lines])

    @property
    def resolution(self) -> tuple[int, int, int]:
        """Lattice points along x, y, z."""
        z, y, x = (line.shape[0] for line in self.lines)
        return x, y, z

    @property
    def ranks(self) -> tuple[int, ...]:
        """Components of each axis pair."""
        return tuple(line.shape[1] for line in self.lines)

    def upsampled(self, resolution: Sequence[int]) -> "TensorVM":
        """Returns the factors resampled linearly to `resolution`; lattice borders stay put."""
        result = TensorVM(resolution, self.ranks)
        for (u, v), k in zip(PLANE_AXES, range(3), strict=True):
            result.planes[k] = nn.Parameter(
                _resized_plane(self.planes[k].detach(), resolution[v], resolution[u])
            )
            result.lines[k] = nn.Parameter(
                _resized_plane(self.lines[k].detach()[:, None], resolution[LINE_AXES[k]], 1)[:, 0]
            )
        return result

    def l1(self) -> Float[Tensor, ""]:
        """Returns the mean magnitude of the factors (TensoRF eq. 8)."""
        return torch.stack([p.abs().mean() for p in (*self.planes, *self.lines)]).sum()

    def total_variation(self) -> Float[Tensor, ""]:
        """Returns the mean squared difference of neighboring plane cells.

        Squared, without the root of the paper's equation: its gradient is finite at 0. Planes one
        cell wide have no neighbors and contribute nothing.
        """
        terms = []
        for plane in self.planes:
            for difference in (plane[1:] - plane[:-1], plane[:, 1:] - plane[:, :-1]):
                if difference.numel():
                    terms.append(difference.square().mean())
        return torch.stack(terms).sum() if terms else self.planes[0].sum() * 0

    @torch.no_grad()
    def add_total_variation_gradient(self, weight: float) -> None:
        """Adds `weight` times the gradient of `total_variation` to that of the planes, in place.

        The same as its backward pass, without temporaries of a plane's size, which cost several
        times as much. Planes that have no gradient yet are left alone.
        """
        for plane in self.planes:
            if plane.grad is None:
                continue
            for first, end in _row_blocks(plane):
                for axis, rows in ((0, slice(first, end + 1)), (1, slice(first, end))):
                    n = plane.shape[axis]
                    scale = 2 * weight * n / (plane.numel() * max(n - 1, 1))
                    _add_differences(plane[rows], plane.grad[rows], axis, scale)

    @torch.no_grad()
    def add_l1_gradient(self, weight: float) -> None:
        """Adds `weight` times the gradient of `l1` to that of the factors, in place."""
        for factor in (*self.planes, *self.lines):
            if factor.grad is None:
                continue
            for first, end in _row_blocks(factor):
                sign = factor[first:end].sign()
                factor.grad[first:end].add_(sign, alpha=weight / factor.numel())


def _row_blocks(factor: Float[Tensor, "..."]) -> Iterator[tuple[int, int]]:
    """Yields the first row and the end of blocks that a CPU's cache holds; on a GPU, of all."""
    n = len(factor)
    rows = n if factor.is_cuda else max(1, _IN_CACHE * n // factor.numel())
    for first in range(0, n, rows):
        yield first, min(first + rows, n)


def _add_differences(
    values: Float[Tensor, "v u c"], grad: Float[Tensor, "v u c"], axis: int, scale: float
) -> None:
    """Adds the gradient of scale / 2 times the sum of squared differences along an axis."""
    n = max(values.shape[axis] - 1, 0)
    difference = values.narrow(axis, min(1, n), n) - values.narrow(axis, 0, n)
    grad.narrow(axis, min(1, n), n).add_(difference, alpha=scale)
    grad.narrow(axis, 0, n).sub_(difference, alpha=scale)


def _resized_plane(
    plane: Float[Tensor, "v u c"], n_rows: int, n_columns: int
) -> Float[Tensor, "new_v new_u c"]:
    image = plane.permute(2, 0, 1)[None]
    resized = functional.interpolate(
        image, (n_rows, n_columns), mode="bilinear", align_corners=True
    )
    return resized[0].permute(1, 2, 0).contiguous()
