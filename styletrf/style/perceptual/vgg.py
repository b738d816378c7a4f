"""VGG16 (Simonyan and Zisserman 2015) up to relu4_3, as a perceptual network.

A layer is named as in the paper: `relu3_2` is the activation after the second convolution of the
third block. The weights are never trained here; gradients flow to the images.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import cast

import torch
from jaxtyping import Float
from safetensors import SafetensorError
from torch import Tensor, nn

from styletrf.errors import InputError
from styletrf.finiteness import load_finite

CONVOLUTIONS: dict[str, tuple[int, int]] = {
    "conv1_1": (3, 64),
    "conv1_2": (64, 64),
    "conv2_1": (64, 128),
    "conv2_2": (128, 128),
    "conv3_1": (128, 256),
    "conv3_2": (256, 256),
    "conv3_3": (256, 256),
    "conv4_1": (256, 512),
    "conv4_2": (512, 512),
    "conv4_3": (512, 512),
}
"""Input and output channels of every 3x3 convolution; a pooling precedes each later block."""

LAYERS: tuple[str, ...] = tuple(name.replace("conv", "relu") for name in CONVOLUTIONS)
"""The available layers, from shallow to deep."""

REDUCTION = 8
"""Side of the square of pixels behind one element of relu4_3's grid."""


class VGG16(nn.Module):
    """The ten convolutions up to relu4_3, and the normalization of their input.

    `mean` and `std` (RGB, in units of [0, 1]) belong to the weights: the convolutions pad with
    zeros, which must be zeros of the normalized image, so they are not folded into conv1_1.
    """

    mean: Tensor
    std: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(3))
        self.register_buffer("std", torch.ones(3))
        for name, (n_in, n_out) in CONVOLUTIONS.items():
            self.add_module(name, nn.Conv2d(n_in, n_out, kernel_size=3, padding=1))

    def features(
        self, images: Float[Tensor, "batch 3 height width"], layers: Iterable[str]
    ) -> dict[str, Tensor]:
        """Returns the named activations, computed no deeper than the deepest of them.

        They are of the dtype of the weights: `network.to(torch.bfloat16)` halves the time where the
        hardware is made for it, for features good to three digits.

        Args:
            images: RGB in [0, 1], at least 8x8.
            layers: Some of `LAYERS`.

        Returns:
            For each layer `batch channels height/2^k width/2^k`, k poolings down (rounded down).

        Raises:
            ValueError: A layer is not one of `LAYERS`.
        """
        wanted = set(layers)
        if unknown := wanted - set(LAYERS):
            raise ValueError(f"no such layers up to relu4_3: {sorted(unknown)}")
        found: dict[str, Tensor] = {}
        x = (images - self.mean[:, None, None]) / self.std[:, None, None]
        x = x.to(self._convolution(LAYERS[0]).weight.dtype)
        for layer in LAYERS:
            if len(found) == len(wanted):
                break
            if layer.endswith("_1") and layer != LAYERS[0]:
                x = nn.functional.max_pool2d(x, 2)
            x = torch.relu(self._convolution(layer)(x))
            if layer in wanted:
                found[layer] = x
        return found

    def _convolution(self, layer: str) -> nn.Conv2d:
        return cast("nn.Conv2d", self.get_submodule(layer.replace("relu", "conv")))


def load_vgg(path: Path, device: torch.device | str = "cpu") -> VGG16:
    """Returns the network with the weights of a `vgg16.safetensors`, frozen.

    Raises:
        InputError: The file is absent, damaged, holds other tensors, or one that is not finite.
    """
    network = VGG16()
    try:
        network.load_state_dict(load_finite(path))
    except (OSError, SafetensorError, RuntimeError) as error:
        problem = f"cannot be read as VGG16 weights ({str(error).splitlines()[0]})"
        raise InputError(str(path), problem, "Build the perceptual weights again") from error
    network.requires_grad_(requires_grad=False).eval()
    for weight in network.parameters():
        if weight.ndim == 4:  # in this layout no convolution copies its weights first
            weight.data = weight.data.contiguous(memory_format=torch.channels_last)
    return network.to(device)
