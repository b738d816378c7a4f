"""The graph of a task: the task, and everything that it needs, directly or not."""

from collections.abc import Callable, Iterator

import luigi

from pipeline.task import StoredTask


def upstream_first(
    *roots: luigi.Task, is_left_out: Callable[[luigi.Task], bool] = lambda _: False
) -> Iterator[luigi.Task]:
    """Yields tasks and all their dependencies, each once, and after its own dependencies.

    Args:
        *roots: The tasks.
        is_left_out: Whether to leave out a task, and the tasks that only it needs. It is called
            once for each task, before the tasks that this one needs.
    """
    seen: set[luigi.Task] = set()

    def visit(task: luigi.Task) -> Iterator[luigi.Task]:
        """Yields the tasks of the graph of one task that were not yielded before."""
        if task in seen:
            return
        seen.add(task)
        if is_left_out(task):
            return
        for upstream in task.deps():  # type: ignore[no-untyped-call]
            yield from visit(upstream)
        yield task

    for root in roots:
        yield from visit(root)


def stored_tasks(
    *roots: luigi.Task, is_left_out: Callable[[StoredTask], bool] = lambda _: False
) -> Iterator[StoredTask]:
    """Yields the tasks of `upstream_first` whose artifacts are stored, in its order.

    Args:
        *roots: The tasks.
        is_left_out: Whether to leave out a stored task, and the tasks that only it needs.
    """
    graph = upstream_first(
        *roots, is_left_out=lambda task: isinstance(task, StoredTask) and is_left_out(task)
    )
    return (task for task in graph if isinstance(task, StoredTask))
