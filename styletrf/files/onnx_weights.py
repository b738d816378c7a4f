"""The weights in an ONNX file, by name, as float32."""

from collections.abc import Mapping

import numpy as np
import onnx
from google.protobuf.message import DecodeError
from jaxtyping import Float
from onnx import NodeProto, numpy_helper

from styletrf.errors import InputError

_DEQUANTIZED = "_dequant"
"""Suffix that tf2onnx gives to the output of a DequantizeLinear node."""


def read_onnx_weights(content: bytes, subject: str) -> dict[str, Float[np.ndarray, "..."]]:
    """Returns the constants of an ONNX graph that are float32, or are dequantized to it.

    A quantized weight is `(x - zero_point) * scale`, one scale for all of it or one for each slice
    along `axis` (ONNX operator DequantizeLinear, version 13). The weight has the name of the node's
    output, without the suffix `_dequant`: layers share initializers of equal value, and outputs are
    unique.

    Args:
        content: The bytes of the file.
        subject: The name of the file in errors.

    Raises:
        InputError: The bytes are no ONNX graph, or a quantized weight does not fit its scale.
    """
    try:
        graph = onnx.load_model_from_string(content).graph
        constants = {item.name: numpy_helper.to_array(item) for item in graph.initializer}
        weights = {name: x for name, x in constants.items() if x.dtype == np.float32}
        for node in graph.node:
            if node.op_type == "DequantizeLinear" and node.input[0] in constants:
                name = node.output[0].removesuffix(_DEQUANTIZED)
                weights[name] = _dequantized(node, constants)
    except (DecodeError, KeyError, TypeError, ValueError) as error:
        problem = f"cannot be read as an ONNX file ({error})".splitlines()[0]
        raise InputError(subject, problem, "Give the file as it was published") from error
    if not weights:
        raise InputError(subject, "holds no weights", "Give the file as it was published")
    return weights


def _dequantized(node: NodeProto, constants: Mapping[str, np.ndarray]) -> Float[np.ndarray, "..."]:
    quantized, scale = (constants[name] for name in node.input[:2])
    zero = constants[node.input[2]] if len(node.input) > 2 else np.zeros_like(scale, np.int32)
    if scale.size > 1:
        axis = next((int(item.i) for item in node.attribute if item.name == "axis"), 1)
        shape = [1] * quantized.ndim
        shape[axis] = -1
        scale, zero = scale.reshape(shape), zero.reshape(shape)
    difference = quantized.astype(np.float32) - zero.astype(np.float32)
    return np.asarray(difference * scale, dtype=np.float32)
