"""Results that are shown in `out/`: folders of links into the store, restored by every run."""

import logging
import os
from abc import abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from pipeline.maintenance.roots import add_folder_root
from pipeline.settings import current_store
from pipeline.task import StoredTask, artifact
from styletrf.errors import InputError
from tasks.stage import Stage

screen = logging.getLogger("pipeline")


class ShownStage(Stage):
    """A stage whose result, and what belongs to it, is linked from a folder of `out/`."""

    @property
    @abstractmethod
    def folder(self) -> Path:
        """Where the result is shown."""

    @abstractmethod
    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns what each name in the folder leads to; `place` tells where an artifact is."""

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


def show_all(cells: Iterable[Any]) -> list[Any]:
    """Shows what is there of a command's cells, whoever made it; what cannot be is a warning.

    Returns:
        The cells that are shown now.
    """
    shown = []
    for cell in (granted for asked in cells for granted in asked.cells()):
        try:
            shown += [cell] if cell.show() else []
        except InputError:  # then there is none, and the reason is told elsewhere
            continue
        except Exception as error:  # noqa: BLE001  the others are shown all the same
            screen.warning("%s cannot be shown: %s", cell.label, error)
    return shown
