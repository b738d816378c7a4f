"""Tasks by their parameters: Luigi adds these to the classes, where no type checker sees them."""

from typing import Any, TypeVar

import luigi

Kind = TypeVar("Kind", bound=luigi.Task)


def task_of(kind: type[Kind], **parameters: Any) -> Kind:
    """Returns the task of a kind with these parameters; Luigi refuses those it does not have."""
    return kind(**parameters)
