"""Style networks to and from the layout of PyTorch's fast-neural-style example.

The example's network is Johnson's in the same form as ours: the names differ, and the units. It
takes and gives colors in [0, 255]; ours in [0, 1], shifted by one half at either end. A shift
before a convolution with reflection padding is one number a channel, which the instance
normalization that follows takes away; scales go into the weights.
"""

import re
from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from styletrf.errors import InputError
from styletrf.finiteness import first_not_finite
from styletrf.style.pickled_tensors import read_pickled
from styletrf.style.style_network import OUTPUT_SCALE, StyleNetwork, StyleNetworkConfig

_RANGE = 255.0
_ENDS = {
    "encoder.1": "conv1.conv2d", "encoder.2": "in1",
    "encoder.5": "conv2.conv2d", "encoder.6": "in2",
    "encoder.9": "conv3.conv2d", "encoder.10": "in3",
    "decoder.2": "deconv1.conv2d", "decoder.3": "in4",
    "decoder.7": "deconv2.conv2d", "decoder.8": "in5",
    "decoder.11": "deconv3.conv2d",
}  # fmt: skip
_BLOCK = {"1": "conv1.conv2d", "2": "in1", "5": "conv2.conv2d", "6": "in2"}
_REMEDY = "Give a checkpoint of PyTorch's fast-neural-style example"
_FIRST, _LAST = "conv1.conv2d", "deconv3.conv2d"


def from_fast_neural_style(path: Path) -> StyleNetwork:
    """Returns the network of a `.pth` or `.model` of the example, of whatever width and depth.

    Running statistics, which versions before PyTorch 0.4 left in the file, do not count: the
    example never used them. Nothing in the file is run.

    Raises:
        InputError: The file is not of this kind.
    """
    loaded = read_pickled(path, "a style network", _REMEDY)
    items = loaded.items() if isinstance(loaded, dict) else ()
    state = {str(name): value for name, value in items if isinstance(value, Tensor)}
    first = state.get(f"{_FIRST}.weight", torch.empty(0))
    if first.ndim != 4 or len(first) == 0:
        raise _no_network(path, "has no layer conv1.conv2d")
    blocks = {int(found[1]) for name in state if (found := re.match(r"res(\d+)\.", name))}
    network = StyleNetwork(StyleNetworkConfig(len(first), len(blocks)))
    ours = {
        name: _layer(path, state, _their_name(name), wanted.shape)
        for name, wanted in network.state_dict().items()
    }
    if bad := first_not_finite(ours.items()):
        raise _no_network(path, f"{_their_name(bad)} is not finite")
    ours["encoder.1.weight"] = ours["encoder.1.weight"] * _RANGE
    last = "decoder.11"
    ours[f"{last}.weight"] = ours[f"{last}.weight"] / (_RANGE * OUTPUT_SCALE)
    ours[f"{last}.bias"] = (ours[f"{last}.bias"] / _RANGE - 0.5) / OUTPUT_SCALE
    network.load_state_dict(ours)
    return network.eval()


def _layer(path: Path, state: Mapping[str, Tensor], name: str, shape: torch.Size) -> Tensor:
    """Returns the layer of a file by its name, which has this shape; in float32."""
    if name not in state:
        raise _no_network(path, f"has no {name}")
    if state[name].shape != shape:
        shapes = f"{tuple(state[name].shape)} instead of {tuple(shape)}"
        raise _no_network(path, f"{name} has the shape {shapes}")
    return state[name].float()


def to_fast_neural_style(network: StyleNetwork) -> dict[str, Tensor]:
    """Returns the state that the example loads; the same network for sides that 4 divides."""
    state = {_their_name(name): value.clone() for name, value in network.state_dict().items()}
    state[f"{_FIRST}.weight"] /= _RANGE
    state[f"{_LAST}.weight"] *= _RANGE * OUTPUT_SCALE
    state[f"{_LAST}.bias"] = _RANGE * (0.5 + OUTPUT_SCALE * state[f"{_LAST}.bias"])
    return state


def _their_name(name: str) -> str:
    module, _, kind = name.rpartition(".")
    if module.startswith("residual."):
        _, block, _, layer = module.split(".")
        return f"res{int(block) + 1}.{_BLOCK[layer]}.{kind}"
    return f"{_ENDS[module]}.{kind}"


def _no_network(path: Path, problem: str) -> InputError:
    return InputError(str(path), f"{problem}: no such style network", _REMEDY)
