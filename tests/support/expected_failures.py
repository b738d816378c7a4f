"""Failures of tasks and of the store that a test expects, by their fields and what they name."""

import re
from contextlib import contextmanager
from pathlib import Path

import pytest
from message_words import mentions

from pipeline.errors import StoreError, TaskFailure
from pipeline.settings import current_store


@contextmanager
def fails(kind: str, task: object, *things: object):
    """Expects a task to fail in this way, for a reason that names all the things."""
    with pytest.raises(TaskFailure) as caught:
        yield caught
    failure = caught.value
    assert (failure.kind, failure.task) == (kind, str(task))
    assert mentions(failure.reason, *things)


@contextmanager
def refuses(*things: object, kind: type[Exception] = StoreError):
    """Expects an error whose message names all the things."""
    with pytest.raises(kind) as caught:
        yield caught
    assert type(caught.value) is kind
    assert mentions(str(caught.value), *things)


def log_named_in(text: str) -> Path:
    """The one log of a build that a text names."""
    logs = re.escape(str(current_store().root / "logs"))
    (log,) = set(re.findall(rf"{logs}/\S+\.log\b", text))
    return Path(log)
