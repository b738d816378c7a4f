"""The style transfer network of Ghiasi et al. (BMVC 2017, arXiv 1705.06830), for one style.

It is Johnson's network (see `styletrf.style.style_network`), four times narrower. Styles differ in
the scale `w` and the shift `b` of every instance normalization (Dumoulin et al. 2017, arXiv
1610.07629),

    y = w (x - mean(x)) / sqrt(var(x) + 1e-5) + b,

with mean and variance of one channel of one image. All other weights serve every style. Scales and
shifts are an affine function of the embedding of a painting, 100 numbers that
`styletrf.style.transfer.style_predictor` finds.
"""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import cast

import torch
from jaxtyping import Float
from torch import Tensor, nn

from styletrf.configuration import require_at_least
from styletrf.style.residual_network import ResidualBlock, draw_convolutions, padded_to_quarters

EMBEDDING_SIZE = 100


@dataclass(frozen=True, slots=True)
class TransferNetworkConfig:
    """The size of the network; the defaults are those of the published weights."""

    widths: tuple[int, int, int] = (8, 16, 32)  # channels of the three contracting convolutions
    n_residual: int = 5  # blocks of two 3x3 convolutions

    def __post_init__(self) -> None:
        require_at_least(0, self, "n_residual")
        if min(self.widths) < 1:
            raise ValueError(f"widths are {self.widths}, not at least 1")


class TransferNetwork(nn.Module):
    """Images in, the same images painted in one style."""

    def __init__(
        self, config: TransferNetworkConfig, generator: torch.Generator | None = None
    ) -> None:
        """Builds the network.

        Args:
            config: The size of the network.
            generator: Draws the initial weights (variance 1 / fan-in); without it torch draws them.
        """
        super().__init__()
        self.config = config
        a, b, c = config.widths
        self.contraction = nn.Sequential(
            *_contracting(3, a, kernel=9), *_contracting(a, b), *_contracting(b, c)
        )
        self.residual = nn.Sequential(*(_residual(c) for _ in range(config.n_residual)))
        self.expansion = nn.Sequential(
            nn.Upsample(scale_factor=2, mode="nearest"),
            *_normalized(c, b),
            nn.ReLU(),
            nn.Upsample(scale_factor=2, mode="nearest"),
            *_normalized(b, a),
            nn.ReLU(),
            *_normalized(a, 3, kernel=9),
            nn.Sigmoid(),
        )
        if generator is not None:
            draw_convolutions(self, generator)

    def forward(
        self, images: Float[Tensor, "batch 3 height width"]
    ) -> Float[Tensor, "batch 3 height width"]:
        """Returns the stylized images, in [0, 1] and of the size they came in.

        Args:
            images: RGB in [0, 1], at least 16x16.

        Raises:
            ValueError: The images are smaller than that.
        """
        height, width = images.shape[-2:]
        y = self.expansion(self.residual(self.contraction(padded_to_quarters(images))))
        return cast("Tensor", y[..., :height, :width])

    def style_parameters(self) -> dict[str, nn.Parameter]:
        """Returns the scale (`.weight`) and shift (`.bias`) of every normalization, by name."""
        return {
            f"{name}.{kind}": cast("nn.Parameter", getattr(module, kind))
            for name, module in self.named_modules()
            if isinstance(module, nn.InstanceNorm2d)
            for kind in ("weight", "bias")
        }

    def shared_parameters(self) -> dict[str, nn.Parameter]:
        """Returns all other parameters, which serve every style, by name."""
        of_style = self.style_parameters()
        return {name: value for name, value in self.named_parameters() if name not in of_style}


class StyleConditioning(nn.Module):
    """Maps the embedding of a painting to all scales and shifts of a transfer network."""

    def __init__(self, config: TransferNetworkConfig) -> None:
        super().__init__()
        with torch.device("meta"):
            parameters = TransferNetwork(config).style_parameters()
        self.sizes = {name: parameter.numel() for name, parameter in parameters.items()}
        self.affine = nn.Linear(EMBEDDING_SIZE, sum(self.sizes.values()))

    def forward(self, embedding: Float[Tensor, "100"]) -> Mapping[str, Float[Tensor, " channels"]]:
        """Returns the style parameters by name, as `TransferNetwork.style_parameters` has them.

        `torch.func.functional_call(network, conditioning(embedding), (images,))` is differentiable
        in the embedding.
        """
        parts = self.affine(embedding).split(list(self.sizes.values()))
        return dict(zip(self.sizes, parts, strict=True))


def conditioned(
    network: TransferNetwork, conditioning: StyleConditioning, embedding: Float[Tensor, "100"]
) -> TransferNetwork:
    """Returns a copy of the network with the scales and shifts of an embedding, to be trained on.

    Args:
        network: Gives the shared parameters, and stays as it is.
        conditioning: Made for a network of this size.
        embedding: The embedding of a painting; see
            `styletrf.style.transfer.style_predictor.style_embedding`.
    """
    copy = deepcopy(network)
    parameters = copy.style_parameters()
    with torch.no_grad():
        for name, value in conditioning(embedding).items():
            parameters[name].copy_(value)
    return copy


def _residual(channels: int) -> ResidualBlock:
    return ResidualBlock(
        *_normalized(channels, channels), nn.ReLU(), *_normalized(channels, channels)
    )


def _contracting(n_in: int, n_out: int, *, kernel: int = 3) -> list[nn.Module]:
    """Returns a convolution whose batch normalization became its bias and part of its weights."""
    stride = 1 if kernel == 9 else 2
    convolution = nn.Conv2d(n_in, n_out, kernel, stride)
    return [nn.ReflectionPad2d(kernel // 2), convolution, nn.ReLU()]


def _normalized(n_in: int, n_out: int, *, kernel: int = 3) -> list[nn.Module]:
    """Returns a convolution without a bias, which the normalization after it would cancel."""
    return [
        nn.ReflectionPad2d(kernel // 2),
        nn.Conv2d(n_in, n_out, kernel, bias=False),
        nn.InstanceNorm2d(n_out, eps=1e-5, affine=True),
    ]
