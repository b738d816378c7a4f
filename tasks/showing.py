"""Results that are shown in `out/`: folders of links into the store, restored by every run."""

import atexit
import os
from abc import abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path

import luigi
from luigi.cmdline_parser import CmdlineParser
from luigi.task_register import Register

from pipeline.roots import show_in
from pipeline.settings import current_store
from pipeline.task import StoredTask, artifact
from tasks.stage import Stage


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
        show_in(current_store(), self.folder, links.values())
        for name, target in links.items():
            partial = self.folder / f".{name}.{os.getpid()}"
            partial.unlink(missing_ok=True)
            partial.symlink_to(target)
            partial.replace(self.folder / name)
        for path in self.folder.iterdir():
            if path.is_symlink() and path.name not in links:
                path.unlink()


def _announce_at_exit(task: ShownStage) -> None:
    """Has the command print where the result is, after everything else it prints."""
    is_command = CmdlineParser.get_instance() is not None  # type: ignore[no-untyped-call]
    if not is_command or task.announced:
        return
    task.announced = True
    process, parameters = os.getpid(), _command_parameters()

    def announce() -> None:
        _adopt(parameters)  # Luigi has forgotten the command line by then
        if os.getpid() == process and Stage.complete(task):
            print(task.folder / "report.html")  # noqa: T201  the command's answer

    atexit.register(announce)


def _command_parameters() -> dict[str, dict[str, str]]:
    """What the command line says of any family of tasks, as `--Family-name value`, by family."""
    parser = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    given = vars(parser.known_args) if parser else {}
    parameters: dict[str, dict[str, str]] = {}
    known = Register.get_all_params()  # type: ignore[no-untyped-call]
    for family, _, name, _ in known:
        if (value := given.get(f"{family}_{name}")) is not None:
            parameters.setdefault(family, {})[name] = str(value)
    return parameters


def _adopt(parameters: Mapping[str, Mapping[str, str]]) -> None:
    """Make another process's `_command_parameters` the defaults in this one."""
    config = luigi.configuration.get_config()  # type: ignore[no-untyped-call]
    for family, values in parameters.items():
        for name, value in values.items():
            config.set(family, name, value.replace("%", "%%"))
