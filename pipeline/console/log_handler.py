"""The log on the console: which records it shows, and how. `logging.cfg` names the handler."""

import logging
import sys

from luigi.parameter import ParameterException
from luigi.rpc import RPCError
from luigi.task_register import TaskClassException

from pipeline.console.progress_client import progress_client
from pipeline.errors import StoreError, TaskFailure

_WITHOUT_TRACEBACK = (TaskFailure, StoreError, ParameterException, RPCError, TaskClassException)


class ConsoleHandler(logging.StreamHandler):  # type: ignore[type-arg]
    """Standard error. It shows the pipeline's records, warnings, and Luigi's summary."""

    def __init__(self) -> None:
        super().__init__(sys.stderr)
        self.addFilter(is_user_facing)
        self.setFormatter(MessageFormatter())

    def emit(self, record: logging.LogRecord) -> None:
        """Writes the record above the live lines, or over a bar of another process."""
        client = progress_client()
        if client and client.write(self.format(record)):
            return
        if self.stream.isatty():
            self.stream.write("\r\x1b[K")
        super().emit(record)


class MessageFormatter(logging.Formatter):
    """The message without a prefix. Exceptions meant for users have no traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """Returns the text for the console."""
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, _WITHOUT_TRACEBACK):
            return in_one_line(error)
        return super().format(record) if record.levelno >= logging.ERROR else record.getMessage()


def is_user_facing(record: logging.LogRecord) -> bool:
    """Whether the console shows a record: of Luigi's own only warnings, errors and the summary."""
    if record.levelno >= logging.WARNING or record.name.startswith("pipeline"):
        return True
    return "Luigi Execution Summary" in record.getMessage()


def in_one_line(error: BaseException) -> str:
    """Returns the text of an exception, without line breaks."""
    return " ".join(str(error).split("\n"))
