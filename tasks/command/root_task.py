"""The task that a command requests, and the parameters that its command line gives it."""

import luigi
from luigi.cmdline_parser import CmdlineParser


def root_of_command() -> luigi.Task | None:
    """Returns the task that the command of this process requests; None outside a command."""
    command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    return command.get_task_obj() if command else None


def is_typed(name: str) -> bool:
    """Returns whether the command line of this process gives its task a parameter, by its name.

    A value that is typed may be the default, too, which a task cannot see.
    """
    command = CmdlineParser.get_instance()  # type: ignore[no-untyped-call]
    return command is not None and getattr(command.known_args, name, None) is not None
