"""Results linked in `out/`: folders of symbolic links into the store, restored by every run."""

import contextlib
import json
import logging
import uuid
from abc import abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, ClassVar

from pipeline.maintenance.roots import add_folder_root, shown_artifacts
from pipeline.settings import current_store, out_root
from pipeline.task import StoredTask, artifact
from styletrf.errors import InputError
from styletrf.files.atomic_write import atomic_write
from tasks.stages.stage import Stage

_log = logging.getLogger("pipeline")


class LinkedStage(Stage):
    """A stage whose result and related files are linked from a folder in `out/`.

    Attributes:
        page: The name of the link that a command prints.
    """

    page: ClassVar[str] = "report.html"

    @property
    @abstractmethod
    def folder(self) -> Path:
        """Returns the folder of the links."""

    @abstractmethod
    def links(self, place: Callable[[StoredTask], Path]) -> dict[str, Path]:
        """Returns the target of each link by its name; `place` returns an artifact's folder."""

    def published(self) -> bool:
        """Returns whether every link has the right target, which exists, and the keys are its own.

        The links alone do not prove it: two commands may have made them in turn.
        """
        folder = self.folder
        keys = made_from(folder / self.page)
        return keys[-1:] == [self.action().key] and all(
            (folder / name).is_symlink()
            and (folder / name).readlink() == target
            and target.exists()
            for name, target in self.links(lambda task: task.output().path).items()
        )

    def publish(self, object_path: Path) -> None:
        """Makes the links, removes links of earlier runs, and lists the keys of the lineage.

        Other commands may do the same at the same time. Links of the user stay. The former keys
        are removed first, since they are not those of the new links. The keys are written last, so
        that the result counts as published after all the rest is done.
        """
        store, links = current_store(), self.links(artifact)
        keys, page = [*self.lineage(), self.action().key], self.folder / self.page
        self.folder.mkdir(parents=True, exist_ok=True)
        add_folder_root(store, self.folder, links.values(), out_root())
        _keys_file(page).unlink(missing_ok=True)
        for name, target in links.items():
            partial = self.folder / f".{name}.{uuid.uuid4().hex}"
            partial.symlink_to(target)
            partial.replace(self.folder / name)
        for path in self.folder.glob("[!.]*"):  # a name with a dot first is a partial link
            is_old = path.is_symlink() and path.name not in links
            if is_old and shown_artifacts(store, path):
                path.unlink(missing_ok=True)
        with atomic_write(_keys_file(page)) as file:
            file.write_text(json.dumps(keys))


def made_from(page: Path) -> list[str]:
    """Returns the keys of all that a linked page was made from, upstream first; last its own.

    Empty for a page that was linked by an earlier version.
    """
    with contextlib.suppress(OSError, ValueError):
        return [str(key) for key in json.loads(_keys_file(page).read_text())]
    return []


def linked_pages(scene: Path) -> list[Path]:
    """Returns the pages in a scene's folder in `out/` of which `made_from` knows the keys."""
    pages = (file.with_suffix("") for file in sorted(scene.rglob("*.keys")))
    return [page for page in pages if page.exists()]


def _keys_file(page: Path) -> Path:
    return page.with_name(f"{page.name}.keys")


def link_results(cells: Iterable[Any]) -> list[Any]:
    """Links all existing results of a command's cells, also those that other machines built.

    Returns:
        The results that are linked now.
    """
    linked = []
    for cell in (each for requested in cells for each in requested.cells()):
        try:
            linked += [cell] if cell.show() else []
        except InputError:  # its result cannot exist, and its stage reports the error
            continue
        except Exception as error:  # noqa: BLE001  the other results are linked anyway
            _log.warning("%s cannot be linked in out/: %s", cell.label, error)
    return linked
