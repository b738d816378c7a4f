"""The grid: every style on every scene."""

from collections.abc import Sequence

import luigi
from luigi.util import inherits

from pipeline.errors import TaskFailure
from pipeline.parameters import NamesParameter
from styletrf.errors import InputError
from styletrf.steps.sharding import shard_of
from tasks.results.listed_names import require_names
from tasks.results.trajectory import StylizedTrajectory
from tasks.stages.linked_results import link_results

_OWN = {"scenes", "styles", "part", "plan", "json"}
"""The parameters of the grid itself; a cell gets all others."""


@inherits(StylizedTrajectory)  # type: ignore[no-untyped-call]
class Grid(luigi.WrapperTask):
    """Every style on every scene; stages that cells share are built once.

    `out/index.html` shows all results, and why missing ones could not be made.
    Has all parameters of a cell, `StylizedTrajectory`, except those set to None here.
    """

    scenes = NamesParameter(description='such as ["horns", "fern"]')
    styles = NamesParameter(description='such as ["mosaic", "udnie"]')
    part = luigi.Parameter(
        default="", description="builds a part of the scenes, such as 2/5, for a smaller scheduler"
    )
    scene = style = timeout_seconds = memory_gib = None
    plan: bool
    json: bool
    network: str

    def validate(self) -> None:
        """Rejects invalid lists, an invalid part, and one network for several paintings.

        Raises:
            InputError: A parameter is invalid; the error names a valid one.
        """
        for option, names in {"--scenes": self.scenes, "--styles": self.styles}.items():
            require_names(option, names)
            if not names:
                raise InputError(f"{option} []", "is empty", "Name one at least")
        self.cells()
        if self.network and len(self.styles) > 1:
            problem = "is the network of one painting, but there are several styles"
            raise InputError(f"--network {self.network}", problem, "Give one style")

    def run(self) -> None:
        """Links all results, and checks that each exists: other machines may run other code.

        Raises:
            TaskFailure: A result does not exist for this machine.
        """
        link_results(self.cells())
        missing = [f"{cell.scene} {cell.style}" for cell in self.cells() if not cell.complete()]
        if missing:
            raise TaskFailure(
                "changed",
                str(self),
                f"{', '.join(missing)}: made by a machine with other code, packages, settings or"
                " photographs, or in another store. Give all machines the same, and run it again.",
            )

    def requires(self) -> list[StylizedTrajectory]:
        """Returns one result per cell."""
        return self.cells()

    def scenes_of_part(self) -> Sequence[str]:
        """Returns the scenes of `--part`, each with all its styles, which share its field."""
        return shard_of(self.scenes, self.part, "--part")

    def cells(self) -> list[StylizedTrajectory]:
        """Returns the requested results."""
        shared = {name: value for name, value in self.param_kwargs.items() if name not in _OWN}
        cells = [
            shared | {"scene": scene, "style": style}
            for scene in self.scenes_of_part()
            for style in self.styles
        ]
        return [StylizedTrajectory(**cell) for cell in cells]
