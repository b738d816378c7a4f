"""What of all that is logged the screen shows; `logging.cfg` names the handler here."""

import logging
import sys
from types import TracebackType

from luigi.parameter import ParameterException
from luigi.rpc import RPCError
from luigi.task_register import TaskClassException

from pipeline.board import board_of_command
from pipeline.errors import StoreError, TaskFailure

_PLAIN = (TaskFailure, StoreError, ParameterException, RPCError, TaskClassException)


class Screen(logging.StreamHandler):  # type: ignore[type-arg]
    """Standard error, with our lines, warnings and the summary; without Luigi's small talk."""

    def __init__(self) -> None:
        super().__init__(sys.stderr)
        self.addFilter(is_worth_reading)
        self.setFormatter(WithoutTrace())

    def emit(self, record: logging.LogRecord) -> None:
        """Write the record, on the board while there is one, or over a bar that was left there."""
        board = board_of_command()
        if board and board.say(self.format(record)):
            return
        if self.stream.isatty():
            self.stream.write("\r\x1b[K")
        super().emit(record)


class WithoutTrace(logging.Formatter):
    """The message alone; and of a failure that explains itself, its explanation alone."""

    def format(self, record: logging.LogRecord) -> str:
        """The text for the screen."""
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, _PLAIN):
            return " ".join(str(error).split("\n"))
        return super().format(record) if record.levelno >= logging.ERROR else record.getMessage()


def is_worth_reading(record: logging.LogRecord) -> bool:
    """Whether a person wants to see it: Luigi's own talk only from warnings on, and its summary."""
    if record.levelno >= logging.WARNING or record.name.startswith("pipeline"):
        return True
    return "Luigi Execution Summary" in record.getMessage()


def report_plainly(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """As `sys.excepthook`: one line for Ctrl-C, and for what Luigi raises before it can log."""
    if issubclass(kind, KeyboardInterrupt):
        sys.stderr.write("\nInterrupted. The same command goes on from here.\n")
    elif issubclass(kind, _PLAIN):
        sys.stderr.write(" ".join(str(error).split("\n")) + "\n")
    else:
        sys.__excepthook__(kind, error, trace)
