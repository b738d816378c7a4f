"""Results that are shown in `out/`: folders of links into the store, restored by every run."""

import logging
import os
from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

from luigi.cmdline_parser import CmdlineParser

from pipeline.maintenance.attempts import find_blocking_failure
from pipeline.maintenance.roots import add_folder_root
from pipeline.settings import current_store
from pipeline.task import StoredTask, artifact
from styletrf.errors import InputError
from tasks.at_exit import at_exit, root_of_command
from tasks.sources import begin_of_command
from tasks.stage import Stage

screen = logging.getLogger("pipeline")


class ShownStage(Stage):
    """A stage whose result, and what belongs to it, is linked from a folder of `out/`."""

    announced = False

    @property
    @abstractmethod
    def folder(self) -> Path:
        """Where the result is shown."""

    @abstractmethod
    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns what each name in the folder leads to; `place` tells where an artifact is."""

    def complete(self) -> bool:
        """Whether the result is in the store and in `out/`."""
        _announce_at_exit(self)
        return super().complete()

    def published(self) -> bool:
        """Whether every link in the folder leads where it should, to something there."""
        folder = self.folder
        return all(
            (folder / name).is_symlink()
            and (folder / name).readlink() == target
            and target.exists()
            for name, target in self.links(lambda task: task.output().path).items()
        )

    def publish(self, object_path: Path) -> None:
        """Make the links, replacing what an earlier run left."""
        links = self.links(artifact)
        self.folder.mkdir(parents=True, exist_ok=True)
        add_folder_root(current_store(), self.folder, links.values())
        for name, target in links.items():
            partial = self.folder / f".{name}.{os.getpid()}"
            partial.unlink(missing_ok=True)
            partial.symlink_to(target)
            partial.replace(self.folder / name)
        for path in self.folder.iterdir():
            if path.is_symlink() and path.name not in links:
                path.unlink()


def show_all(root: Any) -> None:
    """Shows what is there of a command's cells, whoever made it; what cannot be is a warning."""
    for cell in (granted for asked in root.cells() for granted in asked.cells()):
        try:
            cell.show()
        except InputError:  # then there is none, and the reason is told elsewhere
            continue
        except Exception as error:  # noqa: BLE001  the others are shown all the same
            screen.warning("%s cannot be shown: %s", cell.label, error)


def _announce_at_exit(task: ShownStage) -> None:
    """Has the command print last where the result is, or why there is none."""
    is_command = CmdlineParser.get_instance() is not None  # type: ignore[no-untyped-call]
    if not is_command or task.announced:
        return
    task.announced = True
    is_all = root_of_command() == task  # a grid tells of its cells itself

    def announce() -> None:
        """Prints the path of the page, or the reason."""
        if Stage.complete(task):
            print(task.folder / "report.html")  # noqa: T201  the command's answer
            return
        try:
            problem = (
                find_blocking_failure(task, current_store(), since=begin_of_command())
                if is_all
                else None
            )
        except InputError:  # the command was refused with this very error
            return
        if problem and not problem.is_under_way:
            screen.error("%s was not made. %s: %s", task.label, problem.task, problem.reason)

    at_exit(announce)
