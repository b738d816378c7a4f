"""Magenta's names of the layers of arbitrary style transfer, and ours."""

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from styletrf.errors import InputError
from styletrf.style.transfer.network import (
    StyleConditioning,
    TransferNetwork,
    TransferNetworkConfig,
)
from styletrf.style.transfer.style_predictor import StylePredictor

OnnxWeights = Mapping[str, Float[np.ndarray, "..."]]
Weights = dict[str, Tensor]

_ENDS = {
    "contraction.1": "contract/conv1",
    "contraction.4": "contract/conv2",
    "contraction.7": "contract/conv3",
    "expansion.2": "expand/conv1/conv",
    "expansion.7": "expand/conv2/conv",
    "expansion.11": "expand/conv3/conv",
}
_NORMALIZED = {"expansion.3": "expansion.2", "expansion.8": "expansion.7"}
_NORMALIZED |= {"expansion.12": "expansion.11"}
_BLOCK = {"1": "conv1", "2": "conv1", "5": "conv2", "6": "conv2"}
_STYLE = {"weight": "Conv_1", "bias": "Conv"}  # of a normalization: its scale, its shift


def network_weights(file: OnnxWeights) -> Weights:
    """Returns the state of a `TransferNetwork` from `arbitrary_transform.onnx`.

    The file has no style of its own: scales are one and shifts zero.

    Raises:
        InputError: A layer is not in the file.
    """
    with torch.device("meta"):
        network = TransferNetwork(TransferNetworkConfig())
    of_style = network.style_parameters()
    weights = {
        name: (torch.ones if name.endswith("weight") else torch.zeros)(parameter.shape)
        for name, parameter in of_style.items()
    }
    for name in network.shared_parameters():
        module, _, kind = name.rpartition(".")
        theirs = "weights" if kind == "weight" else "Conv2D_bias"
        weights[name] = _tensor(file, f"transformer/{_layer(module)}/{theirs}")
    return weights


def conditioning_weights(file: OnnxWeights) -> Weights:
    """Returns the state of a `StyleConditioning` from `arbitrary_transform.onnx`.

    Raises:
        InputError: A layer is not in the file.
    """
    with torch.device("meta"):
        names = StyleConditioning(TransferNetworkConfig()).sizes
    matrices, biases = [], []
    for name in names:
        module, _, kind = name.rpartition(".")
        layer = f"style_params/transformer/{_layer(module)}/StyleNorm/{_STYLE[kind]}"
        matrices.append(_tensor(file, f"{layer}/weights").flatten(1))
        biases.append(_tensor(file, f"{layer}/Conv2D_bias").flatten())
    return {"affine.weight": torch.cat(matrices), "affine.bias": torch.cat(biases)}


def predictor_weights(file: OnnxWeights) -> Weights:
    """Returns the state of a `StylePredictor` from `arbitrary_predict.onnx`.

    Raises:
        InputError: A layer is not in the file.
    """
    with torch.device("meta"):
        names = StylePredictor().state_dict()
    weights = {name: _tensor(file, _predictor_layer(name)) for name in names}
    weights["embedding.weight"] = weights["embedding.weight"].flatten(1)
    return weights


def _layer(module: str) -> str:
    """Returns Magenta's name of a convolution, or of the one before a normalization."""
    if module.startswith("residual."):
        _, block, _, index = module.split(".")
        return f"residual/residual{int(block) + 1}/{_BLOCK[index]}"
    return _ENDS[_NORMALIZED.get(module, module)]


def _predictor_layer(name: str) -> str:
    parts = name.split(".")
    theirs = {"weight": "weights", "bias": "Conv2D_bias"}[parts[-1]]
    if parts[0] == "embedding":
        return f"mobilenet_conv/Conv/{theirs}"
    if parts[0] != "blocks":
        return f"MobilenetV2/{'Conv' if parts[0] == 'stem' else 'Conv_1'}/{theirs}"
    block = "expanded_conv" if parts[1] == "0" else f"expanded_conv_{parts[1]}"
    if parts[2] == "depthwise":
        theirs = f"depthwise_{parts[-1]}".replace("weight", "weights")
    return f"MobilenetV2/{block}/{parts[2]}/{theirs}"


def _tensor(file: OnnxWeights, name: str) -> Tensor:
    if name not in file:
        raise InputError(name, "is not in the ONNX file", "Give the file as it was published")
    return torch.from_numpy(np.array(file[name], dtype=np.float32))
