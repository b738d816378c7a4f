"""The feed-forward style network of Johnson, Alahi and Fei-Fei (ECCV 2016), in its usual form.

Reflection padding, instance normalization (Ulyanov et al. 2017), residual blocks at a quarter of
the size, and nearest resizing before convolution in place of deconvolution (Odena et al. 2016).
Instance normalization uses the statistics of the whole image, so a crop of a stylized image is not
the stylized crop: the size at which an image is stylized is part of the look.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

import torch
from jaxtyping import Float
from safetensors import SafetensorError
from safetensors.torch import save_file
from torch import Tensor, nn

from styletrf.configuration import require_at_least
from styletrf.devices import is_faster_in_bfloat16
from styletrf.errors import InputError
from styletrf.finiteness import load_finite, parameter_stages, require_finite
from styletrf.style.residual_network import ResidualBlock, draw_convolutions, padded_to_quarters
from styletrf.style.transfer.network import TransferNetwork, TransferNetworkConfig

OUTPUT_SCALE = 0.1
"""Units of the last layer's output. It sums 81 `width` products, and one step of Adam moves each of
their weights by the learning rate: unscaled, one step could repaint a pixel from black to white."""


@dataclass(frozen=True, slots=True)
class StyleNetworkConfig:
    """The size of the network; the defaults are Johnson's, with 1,679,235 parameters."""

    width: int = 32  # channels of the first convolution; doubled twice
    n_residual: int = 5  # blocks of two 3x3 convolutions

    def __post_init__(self) -> None:
        require_at_least(1, self, "width")
        require_at_least(0, self, "n_residual")


class StyleNetwork(nn.Module):
    """Images in, the same images painted in the one style it was trained for."""

    def __init__(
        self, config: StyleNetworkConfig, generator: torch.Generator | None = None
    ) -> None:
        """Builds the network.

        Args:
            config: The size of the network.
            generator: Draws the initial weights (variance 1 / fan-in); without it torch draws them.
        """
        super().__init__()
        self.config = config
        w = config.width
        self.encoder = nn.Sequential(
            *_block(3, w, kernel=9), *_block(w, 2 * w, stride=2), *_block(2 * w, 4 * w, stride=2)
        )
        self.residual = nn.Sequential(*(_residual(4 * w) for _ in range(config.n_residual)))
        self.decoder = nn.Sequential(
            nn.Upsample(scale_factor=2, mode="nearest"),
            *_block(4 * w, 2 * w),
            nn.Upsample(scale_factor=2, mode="nearest"),
            *_block(2 * w, w),
            nn.ReflectionPad2d(4),
            nn.Conv2d(w, 3, kernel_size=9),
        )
        if generator is not None:
            draw_convolutions(self, generator)

    def forward(
        self, images: Float[Tensor, "batch 3 height width"]
    ) -> Float[Tensor, "batch 3 height width"]:
        """Returns the stylized images, of the size they came in.

        The last layer is affine and its values may leave [0, 1]: training sees them as they are, so
        that no gradient dies; `stylize` clamps.

        Args:
            images: RGB in [0, 1], at least 16x16.

        Raises:
            ValueError: The images are smaller than that.
        """
        height, width = images.shape[-2:]
        x = padded_to_quarters(images - 0.5)
        y = self.decoder(self.residual(self.encoder(x)))
        return cast("Tensor", 0.5 + OUTPUT_SCALE * y[..., :height, :width])


def _residual(channels: int) -> ResidualBlock:
    return ResidualBlock(*_block(channels, channels), *_block(channels, channels)[:-1])


def _block(n_in: int, n_out: int, *, kernel: int = 3, stride: int = 1) -> list[nn.Module]:
    return [
        nn.ReflectionPad2d(kernel // 2),
        nn.Conv2d(n_in, n_out, kernel, stride),
        nn.InstanceNorm2d(n_out, affine=True),
        nn.ReLU(),
    ]


PaintingNetwork = StyleNetwork | TransferNetwork
"""A network that paints in one style: Johnson's, or that of arbitrary style transfer."""


def stylize(
    network: PaintingNetwork, image: Float[Tensor, "height width 3"]
) -> Float[Tensor, "height width 3"]:
    """Returns the painted image, clamped to [0, 1]; no gradient.

    Convolutions are in bfloat16 where that is faster: down to half the time, and less than two
    levels of 255 from float32.

    Args:
        network: A trained network, on the device of the image.
        image: RGB in [0, 1], at least 16x16.

    Raises:
        NotFiniteError: The painted image is not finite; the error names it, or a parameter that is
            not.
    """
    fast = is_faster_in_bfloat16(image.device)
    with torch.inference_mode(), torch.autocast(image.device.type, torch.bfloat16, enabled=fast):
        painted: Tensor = network(image.permute(2, 0, 1)[None])[0]
        if not torch.isfinite(painted).all():  # which clamping would hide
            stages = [("image", image), *parameter_stages(network), ("painted image", painted)]
            require_finite("painting", "in this view", stages)
        return painted.permute(1, 2, 0).float().clamp(0, 1).contiguous()


def save_style_network(network: PaintingNetwork, folder: Path) -> None:
    """Writes `style_network.safetensors` and `style_network.json` into a folder.

    The latter has the architecture, `johnson` or `transfer`, and the size.
    """
    tensors = {name: value.contiguous() for name, value in network.state_dict().items()}
    save_file(tensors, folder / "style_network.safetensors")
    architecture = "johnson" if isinstance(network, StyleNetwork) else "transfer"
    config = {"architecture": architecture, **asdict(network.config)}
    text = json.dumps(config, indent=1, sort_keys=True) + "\n"
    (folder / "style_network.json").write_text(text, encoding="utf-8")


def load_style_network(folder: Path, device: torch.device | str = "cpu") -> PaintingNetwork:
    """Returns the network that `save_style_network` wrote.

    Files of earlier versions name no architecture, and are Johnson's.

    Raises:
        InputError: The files are absent, damaged, not finite, or do not fit each other.
    """
    try:
        config = json.loads((folder / "style_network.json").read_text(encoding="utf-8"))
        network = _network(config)
        network.load_state_dict(load_finite(folder / "style_network.safetensors"))
    except (KeyError, OSError, SafetensorError, RuntimeError, TypeError, ValueError) as error:
        problem = f"cannot be read as a style network ({str(error).splitlines()[0]})"
        raise InputError(str(folder), problem, "Train the style network again") from error
    return network.to(device)


def _network(config: Mapping[str, Any]) -> PaintingNetwork:
    size = {**config}
    architecture = size.pop("architecture", "johnson")
    if architecture == "johnson":
        return StyleNetwork(StyleNetworkConfig(**size))
    if architecture == "transfer":
        widths = tuple(size.pop("widths"))
        return TransferNetwork(TransferNetworkConfig(widths=widths, **size))
    raise ValueError(f"unknown architecture {architecture!r}")
