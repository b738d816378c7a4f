"""The tasks of a command."""

import luigi
from luigi.cmdline_parser import CmdlineParser


def graph(root: luigi.Task) -> list[luigi.Task]:
    """Returns a task and all that is upstream of it, each once."""
    found: dict[str, luigi.Task] = {}
    pending = [root]
    while pending:
        task = pending.pop()
        if task.task_id not in found:
            found[task.task_id] = task
            pending += luigi.task.flatten(task.requires())  # type: ignore[no-untyped-call]
    return list(found.values())


def root_of_command() -> luigi.Task | None:
    """Returns the task that the command of this process asks for; None outside a command."""
    command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    return command.get_task_obj() if command else None
