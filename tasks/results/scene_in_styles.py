"""One scene in several styles on one geometry: the common part of `Viewer` and `Export`."""

from typing import Any

import luigi

from pipeline.parameters import ListParameter
from styletrf.errors import InputError
from tasks.results.listed_names import require_names
from tasks.stages.linked_results import LinkedStage
from tasks.stages.path_parameters import PathParameters
from tasks.stages.style_parameters import NetworkParameters, StyleParameters


class SceneInStyles(LinkedStage, PathParameters):
    """A result that shows one scene in several styles, which share the density of the field."""

    scene = luigi.Parameter(description="a folder in data/scenes")
    styles: Any = ListParameter(description='such as ["mosaic", "udnie"]')
    content = NetworkParameters.content
    perceptual = NetworkParameters.perceptual
    stroke_scale = NetworkParameters.stroke_scale
    content_weight = NetworkParameters.content_weight
    transfer = NetworkParameters.transfer
    stylizer = NetworkParameters.stylizer
    colors = StyleParameters.colors
    strategy = StyleParameters.strategy
    match = StyleParameters.match
    rounds = StyleParameters.rounds

    def validate(self) -> None:
        """Rejects styles that are not each one name, and strategies that change the geometry.

        Raises:
            InputError: A parameter is invalid; the error names a valid one.
        """
        super().validate()
        require_names("--styles", self.styles)
        if any(style.casefold() == "photographs" for style in self.styles):
            problem = "has the name of what is not stylized"
            raise InputError(f"--styles {list(self.styles)}", problem, "Rename the painting")
        if self.strategy != "s3":
            problem = "gives each style a geometry of its own, but all styles have to share one"
            raise InputError(f"--strategy {self.strategy}", problem, "Leave it out: s3 shares one")
