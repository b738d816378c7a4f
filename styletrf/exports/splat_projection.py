"""Projects splats into a picture as 3D Gaussian Splatting does (Kerbl et al. 2023).

A splat's image is nearly a Gaussian with the covariance J R Sigma R^T J^T (Zwicker et al. 2001,
EWA splatting), to which 3DGS adds 0.3 square pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from styletrf.exports.splats import SplatTensors
from styletrf.geometry.cameras import Camera

BLUR_PX2 = 0.3
_NEAREST = 0.01  # of the median depth
_WIDEST = 1.3  # times the view: beyond, the projection's slope is that at the border


@dataclass(frozen=True, slots=True)
class ProjectedSplats:
    """Splats in a picture.

    Attributes:
        centers_px: x and y of the centers.
        covariances_px2: xx, xy, yy of the covariances.
        depth: The depth along the camera's axis.
        is_ahead: Which splats are ahead; the other values of those behind mean nothing.
    """

    centers_px: Float[Tensor, "splats 2"]
    covariances_px2: Float[Tensor, "splats 3"]
    depth: Float[Tensor, " splats"]
    is_ahead: Bool[Tensor, " splats"]


def projected_splats(splats: SplatTensors, camera: Camera) -> ProjectedSplats:
    """Returns splats in a camera's picture; differentiable in all but `is_ahead`.

    Args:
        splats: The splats, in the camera's world.
        camera: The camera of the picture.
    """
    world_from_camera = splats.centers.new_tensor(camera.world_from_camera)
    rotation, center = world_from_camera[:, :3], world_from_camera[:, 3]
    x, y, z = ((splats.centers - center) @ rotation).unbind(1)
    positive = z.detach()[z > 0]
    nearest = _NEAREST * positive.median() if len(positive) else z.new_tensor(0.0)
    is_ahead = z > nearest
    safe = torch.where(is_ahead, z, torch.ones_like(z))
    x, y = x / safe, y / safe
    half = _matrices(splats.rotations) * splats.scales[:, None, :]
    image = _slopes(x, y, safe, camera) @ (rotation.T @ half)
    covariances = image @ image.transpose(1, 2)
    xx, xy, yy = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    return ProjectedSplats(
        torch.stack([camera.fx * x + camera.cx, camera.fy * y + camera.cy], 1),
        torch.stack([xx + BLUR_PX2, xy, yy + BLUR_PX2], 1),
        z.detach(),
        is_ahead,
    )


def _slopes(
    x: Float[Tensor, " splats"],
    y: Float[Tensor, " splats"],
    z: Float[Tensor, " splats"],
    camera: Camera,
) -> Float[Tensor, "splats 2 3"]:
    """Returns the derivatives of pixels by the camera's coordinates, of directions x/z and y/z."""
    wide, high = _WIDEST * camera.width / camera.fx / 2, _WIDEST * camera.height / camera.fy / 2
    x, y = x.clamp(-wide, wide), y.clamp(-high, high)
    zero = torch.zeros_like(z)
    rows = [[camera.fx / z, zero, -camera.fx * x / z], [zero, camera.fy / z, -camera.fy * y / z]]
    return torch.stack([torch.stack(row, 1) for row in rows], 1)


def _matrices(quaternions: Float[Tensor, "n 4"]) -> Float[Tensor, "n 3 3"]:
    w, x, y, z = torch.nn.functional.normalize(quaternions, dim=1).unbind(1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row, 1) for row in rows], 1)
