"""The example's networks paint here as they do there, and ours there as here."""

import subprocess

import pytest
import torch
from expected_errors import rejects
from other_files import OTHER_FILES
from torch import Tensor, nn
from torch.nn import functional

from styletrf.style.export_style import export_style_network, main, to_onnx
from styletrf.style.interchange import from_fast_neural_style, to_fast_neural_style
from styletrf.style.style_network import StyleNetwork, StyleNetworkConfig, save_style_network
from styletrf.style.transfer.network import TransferNetwork, TransferNetworkConfig

SIZE = StyleNetworkConfig(width=4, n_residual=2)


def as_the_example_computes(state: dict[str, Tensor], image: Tensor) -> Tensor:
    """Its forward pass by the names of its layers, on colors in [0, 255]."""

    def convolved(x: Tensor, name: str, stride: int = 1) -> Tensor:
        weight = state[f"{name}.conv2d.weight"]
        padded = functional.pad(x, [weight.shape[-1] // 2] * 4, mode="reflect")
        return functional.conv2d(padded, weight, state[f"{name}.conv2d.bias"], stride)

    def normed(x: Tensor, name: str) -> Tensor:
        return functional.instance_norm(
            x, weight=state[f"{name}.weight"], bias=state[f"{name}.bias"], eps=1e-5
        )

    y = torch.relu(normed(convolved(image, "conv1"), "in1"))
    y = torch.relu(normed(convolved(y, "conv2", 2), "in2"))
    y = torch.relu(normed(convolved(y, "conv3", 2), "in3"))
    for k in range(1, 1 + sum(n.endswith("in1.weight") and n.startswith("res") for n in state)):
        z = torch.relu(normed(convolved(y, f"res{k}.conv1"), f"res{k}.in1"))
        y = y + normed(convolved(z, f"res{k}.conv2"), f"res{k}.in2")
    for name, norm in (("deconv1", "in4"), ("deconv2", "in5")):
        y = functional.interpolate(y, scale_factor=2, mode="nearest")
        y = torch.relu(normed(convolved(y, name), norm))
    return convolved(y, "deconv3")


@pytest.fixture
def network() -> StyleNetwork:
    generator = torch.Generator().manual_seed(0)
    network = StyleNetwork(SIZE, generator)
    for module in network.modules():
        if isinstance(module, nn.InstanceNorm2d | nn.Conv2d):
            nn.init.normal_(module.bias, std=0.3, generator=generator)
    return network.eval()


IMAGE = torch.rand(1, 3, 24, 32, generator=torch.Generator().manual_seed(1))


def test_our_network_paints_in_the_example_as_here(network):
    with torch.no_grad():
        there = as_the_example_computes(to_fast_neural_style(network), 255 * IMAGE) / 255
        torch.testing.assert_close(there, network(IMAGE), atol=1e-4, rtol=0)


@pytest.mark.parametrize("running", [False, True])
def test_a_network_of_the_example_paints_here_as_there(tmp_path, network, running):
    """Also where the file has the running statistics that nobody used."""
    state = to_fast_neural_style(network)
    generator = torch.Generator().manual_seed(2)
    state = {
        name: value + 0.05 * torch.randn(value.shape, generator=generator)
        for name, value in state.items()
    }
    stored = dict(state)
    if running:
        for name in [n for n in state if ".in" in n or n.startswith("in")]:
            stored[name.rpartition(".")[0] + ".running_mean"] = torch.full((3,), 7.0)
            stored[name.rpartition(".")[0] + ".running_var"] = torch.full((3,), 9.0)
    torch.save(stored, tmp_path / "mosaic.pth")
    ours = from_fast_neural_style(tmp_path / "mosaic.pth")
    assert ours.config == SIZE
    with torch.no_grad():
        there = as_the_example_computes(state, 255 * IMAGE) / 255
        torch.testing.assert_close(ours(IMAGE), there, atol=2e-3, rtol=1e-3)


@pytest.mark.parametrize(
    "values",
    [
        {"conv1.conv2d.weight": 3},
        {"conv1.conv2d.weight": torch.tensor(1.0)},
        {"conv1.conv2d.weight": torch.zeros(0, 3, 9, 9)},
        {"in5.weight": 3},
        {"in5.weight": torch.ones(9)},
        {"in5.weight": torch.tensor([torch.nan] * 4)},
    ],
)
def test_weights_of_other_kinds_or_sizes_are_refused_in_one_line(tmp_path, network, values):
    torch.save(to_fast_neural_style(network) | values, tmp_path / "n.pth")
    with rejects(tmp_path / "n.pth") as caught:
        from_fast_neural_style(tmp_path / "n.pth")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", OTHER_FILES)
def test_a_file_that_is_no_checkpoint_is_refused(tmp_path, content):
    (tmp_path / "n.pth").write_bytes(content)
    with rejects(tmp_path / "n.pth") as caught:
        from_fast_neural_style(tmp_path / "n.pth")
    assert caught.value.__cause__ is not None


@pytest.mark.parametrize("saved", [[1, 2], {1: torch.zeros(2)}, torch.zeros(2)])
def test_what_is_no_table_of_weights_is_refused(tmp_path, saved):
    torch.save(saved, tmp_path / "n.pth")
    with rejects(tmp_path / "n.pth", "conv1.conv2d"):
        from_fast_neural_style(tmp_path / "n.pth")


@pytest.mark.parametrize("damage", ["text", "other", "cut", "code"])
def test_what_is_no_such_network_is_refused(tmp_path, network, damage):
    path, state = tmp_path / "n.pth", to_fast_neural_style(network)
    if damage == "text":
        path.write_text("not a network")
    elif damage == "other":
        del state["in5.weight"]
        torch.save(state, path)
    elif damage == "cut":
        torch.save(state, path)
        path.write_bytes(path.read_bytes()[:-200])
    else:
        torch.save({"conv1.conv2d.weight": subprocess.run}, path)
    with rejects(path):
        from_fast_neural_style(path)


@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::DeprecationWarning")  # torch's own
def test_onnx_paints_the_same_at_any_size(tmp_path, network):
    pytest.importorskip("onnxscript", reason="onnxscript is not installed (extra onnx)")
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime is not installed (extra dev)")
    to_onnx(network, tmp_path / "n.onnx")
    session = runtime.InferenceSession(str(tmp_path / "n.onnx"))
    for size in ((24, 32), (37, 50)):
        image = torch.rand(1, 3, *size, generator=torch.Generator().manual_seed(3))
        (painted,) = session.run(None, {"image": image.numpy()})
        with torch.no_grad():
            torch.testing.assert_close(torch.from_numpy(painted), network(image), atol=1e-4, rtol=0)


@pytest.mark.parametrize(
    ("name", "subject"),
    [("n.txt", "n.txt"), ("n", "n"), ("absent/n.pth", "absent"), ("absent/n.onnx", "absent")],
)
def test_a_file_of_no_known_format_or_folder_is_refused_before_it_is_written(
    tmp_path, network, name, subject
):
    save_style_network(network, tmp_path)
    with rejects(tmp_path / subject):
        export_style_network(tmp_path, tmp_path / name)
    assert not (tmp_path / name).exists()


def test_a_network_of_style_transfer_is_refused_as_the_examples(tmp_path):
    save_style_network(TransferNetwork(TransferNetworkConfig((2, 2, 2), 1)), tmp_path)
    with rejects(tmp_path, remedy=[".onnx", '"warm_start"']):
        export_style_network(tmp_path, tmp_path / "n.pth")


def test_the_command_converts_and_says_what_is_wrong(tmp_path, network, capsys):
    save_style_network(network, tmp_path)
    assert main([str(tmp_path), str(tmp_path / "n.pth")]) == 0
    assert from_fast_neural_style(tmp_path / "n.pth").config == SIZE
    assert main([str(tmp_path / "x"), str(tmp_path / "n.pth")]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"{tmp_path / 'x'}")
    assert "style network" in said
