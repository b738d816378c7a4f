"""One scene in several styles on one geometry: the common part of `Viewer` and `Export`."""

from typing import Any

from pipeline.parameters import NameParameter, NamesParameter
from styletrf.errors import InputError
from tasks.results.listed_names import require_names
from tasks.stages.linked_results import LinkedStage
from tasks.stages.path_parameters import PathParameters
from tasks.stages.style_parameters import NetworkParameters, StyleParameters


class SceneInStyles(LinkedStage, PathParameters):
    """A result that shows one scene in several styles, which share the density of the field."""

    scene = NameParameter(description="a folder in data/scenes")
    styles: Any = NamesParameter(description='such as ["mosaic", "udnie"]')
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
        for style in self.styles:
            require_other_name(f"--styles {list(self.styles)}", style)
        if self.strategy != "s3":
            problem = "gives each style a geometry of its own, but all styles have to share one"
            raise InputError(f"--strategy {self.strategy}", problem, "Leave it out: s3 shares one")


def is_name_of_photographs(style: str) -> bool:
    """Returns whether a style has the name of the look that is not stylized."""
    return style.casefold() == "photographs"


def require_other_name(subject: str, style: str) -> None:
    """Rejects a style with the name of the look that is not stylized.

    Raises:
        InputError: The style has this name; the error is of the subject.
    """
    if is_name_of_photographs(style):
        raise InputError(subject, "has the name of what is not stylized", "Rename the painting")
