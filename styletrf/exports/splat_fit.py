"""Splats fitted to pictures of a field by gradient descent (Kerbl et al. 2023).

Splats begin on the field's surfaces, so a few hundred pictures suffice, and no splat has to be
added or removed. All looks are fitted at once: they share centers, extents and opacities, and
differ in the colors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.exports.splat_pictures import splat_picture
from styletrf.exports.splats import SplatTensors
from styletrf.geometry.cameras import Camera
from styletrf.progress import Progress, silent

_LEAST_LEFT = 3e-3  # of a pixel's light, while splats are fitted

Colors = Float[Tensor, "splats channels"]


@dataclass(frozen=True, slots=True)
class SplatFitConfig:
    """Settings of the fit of splats by Adam.

    Attributes:
        iterations: The number of iterations, each of one camera.
        opacity: The opacity of all splats in the beginning.
        center_rate: The rate of centers, in mean deviations of the splat.
        scale_rate: The rate of the logarithms of scales.
        rotation_rate: The rate of unit quaternions.
        opacity_rate: The rate of the logits of opacities.
        color_rate: The rate of colors in [0, 1].
        last_rate: The fraction of the rates at the end, to which they fall exponentially.
        seed: Decides the order of the cameras.
    """

    iterations: int = 300
    opacity: float = 0.8
    center_rate: float = 0.12
    scale_rate: float = 0.05
    rotation_rate: float = 0.04
    opacity_rate: float = 0.2
    color_rate: float = 0.04
    last_rate: float = 0.1
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Pictures:
    """Pictures of a scene by its cameras, the colors of all looks side by side.

    Attributes:
        cameras: The cameras, in the splats' world.
        colors: The colors that each sees, in [0, 1].
        background: The colors behind everything.
    """

    cameras: Sequence[Camera]
    colors: Sequence[Float[Tensor, "_ _ channels"]]
    background: Float[Tensor, " channels"]


def fitted_splats(
    splats: SplatTensors,
    pictures: Pictures,
    config: SplatFitConfig,
    progress: Progress = silent,
) -> tuple[SplatTensors, Colors]:
    """Returns splats that look like pictures, and their colors in [0, 1].

    Args:
        splats: The splats from which the fit begins; their opacities do not matter.
        pictures: The pictures to fit to.
        config: The settings of the fit.
        progress: Called after every iteration.
    """
    size = splats.scales.mean(1, keepdim=True)
    moved = torch.zeros_like(splats.centers, requires_grad=True)
    scales = splats.scales.log().requires_grad_()
    rotations = splats.rotations.clone().requires_grad_()
    opacities = torch.full_like(splats.opacities, config.opacity).logit().requires_grad_()
    colors = mean_colors(splats, pictures).requires_grad_()
    optimizer = torch.optim.Adam([
        {"params": [moved], "lr": config.center_rate},
        {"params": [scales], "lr": config.scale_rate},
        {"params": [rotations], "lr": config.rotation_rate},
        {"params": [opacities], "lr": config.opacity_rate},
        {"params": [colors], "lr": config.color_rate},
    ], betas=(0.9, 0.99), eps=1e-15)  # fmt: skip
    decay = config.last_rate ** (1 / max(config.iterations, 1))
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, decay)

    def fitted() -> SplatTensors:
        centers = splats.centers + size * moved
        return SplatTensors(centers, scales.exp(), rotations, opacities.sigmoid())

    for iteration, k in enumerate(_order(len(pictures.cameras), config)):
        shown = splat_picture(
            fitted(), colors, pictures.cameras[k], pictures.background, _LEAST_LEFT
        )
        loss = (shown - pictures.colors[k]).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        progress(iteration + 1, config.iterations)
    last = fitted()
    parts = (getattr(last, name).detach() for name in SplatTensors.__slots__)
    return SplatTensors(*parts), colors.detach().clamp(0, 1)


def mean_colors(splats: SplatTensors, pictures: Pictures) -> Colors:
    """Returns the mean color of each splat's pixels, by its weights there.

    Weights are the derivatives of a picture by colors, so the gradient of sum(picture . shown) by
    colors is the weighted sum, whatever is shown.
    """
    channels = len(pictures.background)
    any_colors = torch.zeros(len(splats.centers), channels + 1, requires_grad=True)
    sums = torch.zeros_like(any_colors)
    for camera, picture in zip(pictures.cameras, pictures.colors, strict=True):
        with_one = torch.cat([picture, torch.ones_like(picture[..., :1])], dim=-1)
        shown = splat_picture(splats, any_colors, camera, torch.zeros(channels + 1))
        sums += torch.autograd.grad((shown * with_one).sum(), any_colors)[0]
    return sums[:, :-1] / sums[:, -1:].clamp_min(1e-9)


def _order(cameras: int, config: SplatFitConfig) -> list[int]:
    """Returns cameras in random order, each about as often as the others."""
    generator = torch.Generator().manual_seed(config.seed)
    rounds = -(-config.iterations // cameras)
    orders = [torch.randperm(cameras, generator=generator) for _ in range(rounds)]
    return torch.cat(orders)[: config.iterations].tolist() if orders else []
