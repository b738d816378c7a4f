"""The task that a command requests."""

import luigi
from luigi.cmdline_parser import CmdlineParser


def root_of_command() -> luigi.Task | None:
    """Returns the task that the command of this process requests; None outside a command."""
    command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    return command.get_task_obj() if command else None
