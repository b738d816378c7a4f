"""ONNX files with random weights in the layout of arbitrary style transfer: quantized, no graph."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import onnx
from onnx import helper, numpy_helper

CONTRACTION = {"conv1": (8, 3, 9, 9), "conv2": (16, 8, 3, 3), "conv3": (32, 16, 3, 3)}
EXPANSION = {"conv1": (16, 32, 3, 3), "conv2": (8, 16, 3, 3), "conv3": (3, 8, 9, 9)}
INVERTED_RESIDUALS = (  # channels in, wide, out
    (32, 32, 16), (16, 96, 24), (24, 144, 24), (24, 144, 32), (32, 192, 32), (32, 192, 32),
    (32, 192, 64), (64, 384, 64), (64, 384, 64), (64, 384, 64), (64, 384, 96), (96, 576, 96),
    (96, 576, 96), (96, 576, 160), (160, 960, 160), (160, 960, 160), (160, 960, 320),
)  # fmt: skip
Shapes = Iterator[tuple[str, tuple[int, ...]]]


def transform_shapes() -> Shapes:
    for name, shape in CONTRACTION.items():
        yield f"transformer/contract/{name}/weights", shape
        yield f"transformer/contract/{name}/Conv2D_bias", shape[:1]
    normalized = {f"residual/residual{i}/conv{j}": (32, 32, 3, 3)
                  for i in range(1, 6) for j in (1, 2)}  # fmt: skip
    normalized |= {f"expand/{name}/conv": shape for name, shape in EXPANSION.items()}
    for name, shape in normalized.items():
        yield f"transformer/{name}/weights", shape
        for kind in ("Conv", "Conv_1"):
            layer = f"style_params/transformer/{name}/StyleNorm/{kind}"
            yield f"{layer}/weights", (shape[0], 100, 1, 1)
            yield f"{layer}/Conv2D_bias", shape[:1]


def predict_shapes() -> Shapes:
    yield "MobilenetV2/Conv/weights", (32, 3, 3, 3)
    yield "MobilenetV2/Conv/Conv2D_bias", (32,)
    for index, (n_in, wide, n_out) in enumerate(INVERTED_RESIDUALS):
        block = "MobilenetV2/expanded_conv" + (f"_{index}" if index else "")
        if index:
            yield f"{block}/expand/weights", (wide, n_in, 1, 1)
            yield f"{block}/expand/Conv2D_bias", (wide,)
        yield f"{block}/depthwise/depthwise_weights", (wide, 1, 3, 3)
        yield f"{block}/depthwise/depthwise_bias", (wide,)
        yield f"{block}/project/weights", (n_out, wide, 1, 1)
        yield f"{block}/project/Conv2D_bias", (n_out,)
    yield "MobilenetV2/Conv_1/weights", (1280, 320, 1, 1)
    yield "MobilenetV2/Conv_1/Conv2D_bias", (1280,)
    yield "mobilenet_conv/Conv/weights", (100, 1280, 1, 1)
    yield "mobilenet_conv/Conv/Conv2D_bias", (100,)


def quantized_file(shapes: Shapes, seed: int = 0) -> bytes:
    """An ONNX file of int8 weights, with a scale for each output channel."""
    rng, constants, nodes = np.random.default_rng(seed), {}, []
    for name, shape in shapes:
        fan_in = int(np.prod(shape[1:]))
        constants[name] = rng.integers(-127, 128, shape, dtype=np.int8)
        constants[f"{name}_scale"] = np.full(shape[0], (3 / fan_in) ** 0.5 / 127, np.float32)
        constants[f"{name}_zero"] = np.zeros(shape[0], np.int8)
        inputs = [name, f"{name}_scale", f"{name}_zero"]
        nodes.append(helper.make_node("DequantizeLinear", inputs, [f"{name}_dequant"], axis=0))
    initializers = [numpy_helper.from_array(x, name) for name, x in constants.items()]
    graph = helper.make_graph(nodes, "weights", [], [], initializers)
    return onnx.ModelProto.SerializeToString(helper.make_model(graph))


def write_transfer_files(folder: Path) -> Path:
    """Writes both files into a folder, and returns it."""
    (folder / "arbitrary_predict.onnx").write_bytes(quantized_file(predict_shapes()))
    (folder / "arbitrary_transform.onnx").write_bytes(quantized_file(transform_shapes()))
    return folder
