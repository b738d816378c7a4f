"""Pictures of splats, differentiable in all parameters of a splat."""

from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.exports.splat_kernels import LEAST_ALPHA, composite, composite_backward
from styletrf.exports.splat_projection import ProjectedSplats, projected_splats
from styletrf.exports.splats import SplatTensors
from styletrf.geometry.cameras import Camera


def splat_picture(
    splats: SplatTensors,
    colors: Float[Tensor, "splats channels"],
    camera: Camera,
    background: Float[Tensor, " channels"],
    least_left: float = 1e-4,
) -> Float[Tensor, "height width channels"]:
    """Returns a camera's picture of splats; differentiable in splats and colors, on the CPU.

    Args:
        splats: The splats, in the camera's world.
        colors: The colors of each.
        camera: The camera of the picture.
        background: The color behind everything.
        least_left: A pixel takes no further splats once less of its light is left.
    """
    seen = projected_splats(splats, camera)
    conics = _inverses(seen.covariances_px2)
    with torch.no_grad():
        reaches = 2 * (splats.opacities / float(LEAST_ALPHA)).clamp_min(1.0).log()
        rows, order = _places(seen, reaches, camera)
    picture: Tensor = _Composited.apply(  # type: ignore[no-untyped-call]
        order, seen.centers_px, conics, reaches, rows, splats.opacities, colors, background,
        (camera.width, camera.height, least_left),
    )  # fmt: skip
    return picture.reshape(camera.height, camera.width, -1)


def _inverses(covariances: Float[Tensor, "splats 3"]) -> Float[Tensor, "splats 3"]:
    """Returns xx, xy, yy of the inverses, without the determinant, which may underflow."""
    xx, xy, yy = covariances.unbind(1)
    along_x = (xx - xy * xy / yy).reciprocal()
    return torch.stack([along_x, -xy / yy * along_x, (yy - xy * xy / xx).reciprocal()], 1)


def _places(
    seen: ProjectedSplats, reaches: Float[Tensor, " splats"], camera: Camera
) -> tuple[Int64[Tensor, "splats 2"], Int64[Tensor, " seen"]]:
    """Returns the rows, from and to, of each splat, and the splats in the picture by depth."""
    (x, y), (xx, _, yy) = seen.centers_px.unbind(1), seen.covariances_px2.unbind(1)
    wide, high = (reaches * xx).sqrt(), (reaches * yy).sqrt()
    rows = torch.stack([(y - 0.5 - high).ceil(), (y - 0.5 + high).floor() + 1], 1)
    rows = rows.clamp(0, camera.height).long()
    is_in = seen.is_ahead & (reaches > 0) & (rows[:, 0] < rows[:, 1])
    is_in &= (x + wide > 0) & (x - wide < camera.width)
    index = is_in.nonzero()[:, 0]
    return rows, index[seen.depth[index].argsort(stable=True)]


class _Composited(torch.autograd.Function):
    """`splat_kernels.composite` with its gradient."""

    @staticmethod
    def forward(
        ctx: Any, order: Tensor, at: Tensor, conics: Tensor, reaches: Tensor, rows: Tensor,
        opacities: Tensor, colors: Tensor, background: Tensor, frame: tuple[int, int, float],
    ) -> Tensor:  # fmt: skip
        """Returns the picture, pixel by pixel, and keeps the tensors that its gradient needs."""
        tensors = (order, at, conics, reaches, rows, opacities, colors)
        arrays = [each.detach().contiguous().numpy() for each in tensors]
        width, height, least_left = frame
        frame_ = (width, height, np.float32(least_left))
        picture = composite(*arrays, background.numpy(), *frame_)
        ctx.arguments, ctx.picture = (*arrays, *frame_), picture
        return torch.from_numpy(picture)

    @staticmethod
    def backward(ctx: Any, slope: Tensor) -> Any:
        """Returns the gradients by the arguments of `forward`, None where there is none."""
        total = torch.from_numpy(
            composite_backward(*ctx.arguments, ctx.picture, slope.contiguous().numpy())
        )
        at, conics, opacities, colors = total.split([2, 3, 1, total.shape[1] - 6], 1)
        return None, at, conics, None, None, opacities[:, 0], colors, None, None
