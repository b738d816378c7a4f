"""The grid: every style on every scene."""

from collections.abc import Sequence

import luigi

from pipeline.errors import TaskFailure
from pipeline.parameters import ListParameter
from styletrf.errors import InputError
from tasks.shards import part_of
from tasks.showing import show_all
from tasks.trajectory import CONTROLS, StylizedTrajectory


class Grid(luigi.WrapperTask):
    """Every style on every scene; what one cell shares with another is made once.

    `out/index.html` shows them all, and why those are missing that could not be made.
    """

    scenes = ListParameter(description='such as ["horns", "fern"]')
    part = luigi.Parameter(
        default="", description="a part of the scenes alone, such as 2/5, for a scheduler's sake"
    )
    styles = ListParameter(description='such as ["mosaic", "udnie"]')
    quality = StylizedTrajectory.quality
    budget = StylizedTrajectory.budget
    plan = StylizedTrajectory.plan  # type: ignore[misc]
    json = StylizedTrajectory.json  # type: ignore[misc]
    tuning = StylizedTrajectory.tuning
    keep_going = StylizedTrajectory.keep_going  # type: ignore[misc]
    device = StylizedTrajectory.device
    until = StylizedTrajectory.until
    executor = StylizedTrajectory.executor
    shards = StylizedTrajectory.shards
    content = StylizedTrajectory.content
    perceptual = StylizedTrajectory.perceptual
    stroke_scale = StylizedTrajectory.stroke_scale
    content_weight = StylizedTrajectory.content_weight
    transfer = StylizedTrajectory.transfer
    network = StylizedTrajectory.network
    stylizer = StylizedTrajectory.stylizer
    colors = StylizedTrajectory.colors
    strategy = StylizedTrajectory.strategy
    match = StylizedTrajectory.match
    rounds = StylizedTrajectory.rounds
    method = StylizedTrajectory.method
    strength = StylizedTrajectory.strength
    blend = StylizedTrajectory.blend
    region = StylizedTrajectory.region
    path = StylizedTrajectory.path
    seconds = StylizedTrajectory.seconds
    frame_rate = StylizedTrajectory.frame_rate
    frame_size = StylizedTrajectory.frame_size

    def require_sound(self) -> None:
        """Refuses parts that are none, and one network for several paintings.

        Raises:
            InputError: With what to give instead.
        """
        self.cells()
        if self.json and not self.plan:
            raise InputError("--json", "is for --plan alone", "Add --plan, or leave it out")
        if self.network and len(self.styles) > 1:
            problem = "is one painting's network, for several styles"
            raise InputError(f"--network {self.network}", problem, "Give one style")

    def run(self) -> None:
        """Show all; and look once more: another machine may have made some of other code.

        Raises:
            TaskFailure: Not every result is there for this machine.
        """
        show_all(self.cells())
        missing = [f"{cell.scene} {cell.style}" for cell in self.cells() if not cell.complete()]
        if missing:
            raise TaskFailure(
                "changed",
                str(self),
                f"{', '.join(missing)}: made by a machine with other code, packages, settings or"
                " photographs, or in another store. Give all machines the same, and run it again.",
            )

    def requires(self) -> list[StylizedTrajectory]:
        """One result a cell."""
        return self.cells()

    def of_part(self) -> Sequence[str]:
        """The scenes asked for; all styles of a scene are of one part, which share its field."""
        return part_of(self.scenes, f"--part {self.part}") if self.part else self.scenes

    def cells(self) -> list[StylizedTrajectory]:
        """The results asked for."""
        how = ("device", "until", "executor", "shards", "keep_going")
        what = ("quality", "budget", "tuning", "content", "perceptual", *CONTROLS)
        shared = {name: self.param_kwargs[name] for name in (*how, *what)}
        cells = [
            shared | {"scene": scene, "style": style}
            for scene in self.of_part()
            for style in self.styles
        ]
        return [StylizedTrajectory(**cell) for cell in cells]
