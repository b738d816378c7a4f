import numpy as np
import onnx
import pytest
from expected_errors import rejects
from onnx import helper, numpy_helper

from styletrf.files.onnx_weights import read_onnx_weights


def file_of(constants: dict[str, np.ndarray], nodes: list[onnx.NodeProto]) -> bytes:
    initializers = [numpy_helper.from_array(x, name) for name, x in constants.items()]
    model = helper.make_model(helper.make_graph(nodes, "weights", [], [], initializers))
    return model.SerializeToString()


def dequantize(inputs: list[str], output: str, **attributes: int) -> onnx.NodeProto:
    return helper.make_node("DequantizeLinear", inputs, [output], **attributes)


def test_float_weights_are_read_as_they_are():
    x = np.random.default_rng(0).normal(size=(2, 3)).astype(np.float32)
    np.testing.assert_array_equal(read_onnx_weights(file_of({"x": x}, []), "f")["x"], x)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_each_slice_has_its_scale_and_zero_point(axis: int):
    rng = np.random.default_rng(0)
    x = rng.integers(0, 256, (3, 3, 3), dtype=np.uint8)
    scale = rng.uniform(0.1, 1, 3).astype(np.float32)
    zero = rng.integers(0, 256, 3, dtype=np.uint8)
    nodes = [dequantize(["q", "s", "z"], "w_dequant", axis=axis)]
    found = read_onnx_weights(file_of({"q": x, "s": scale, "z": zero}, nodes), "f")["w"]
    for index in range(3):
        part = np.take(x, index, axis).astype(float)
        exact = scale[index] * (part - float(zero[index]))
        np.testing.assert_allclose(np.take(found, index, axis), exact, rtol=1e-6)


def test_one_scale_without_zero_point_serves_all():
    x, scale = np.array([-3, 4], np.int32), np.array(0.5, np.float32)
    found = read_onnx_weights(file_of({"q": x, "s": scale}, [dequantize(["q", "s"], "w")]), "f")
    np.testing.assert_array_equal(found["w"], np.array([-1.5, 2], np.float32))


def test_initializers_that_layers_share_come_under_both_names():
    constants = {"a": np.array([2], np.int8), "s": np.array(1, np.float32)}
    constants["t"] = np.array(3, np.float32)
    nodes = [dequantize(["a", "s"], "a_dequant"), dequantize(["a", "t"], "b_dequant")]
    found = read_onnx_weights(file_of(constants, nodes), "f")
    assert (float(found["a"][0]), float(found["b"][0])) == (2, 6)


def test_quantized_activations_are_no_weights():
    nodes = [dequantize(["activation", "s"], "y")]
    content = file_of({"s": np.array(1, np.float32)}, nodes)
    assert set(read_onnx_weights(content, "f")) == {"s"}


@pytest.mark.parametrize(
    "content",
    [b"", b"a text, no graph", file_of({"x": np.ones(2, np.float32)}, [])[:-3]],
    ids=["empty", "text", "cut short"],
)
def test_what_is_no_graph_is_an_input_error(content: bytes):
    with rejects("my file"):
        read_onnx_weights(content, "my file")


def test_scales_that_do_not_fit_are_an_input_error():
    constants = {"q": np.zeros((2, 2), np.int8), "s": np.ones(3, np.float32)}
    nodes = [dequantize(["q", "s"], "w", axis=0)]
    with rejects("f", "ONNX"):
        read_onnx_weights(file_of(constants, nodes), "f")
