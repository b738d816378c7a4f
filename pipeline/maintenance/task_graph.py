"""The graph of a task: the task, and everything that it needs, directly or not."""

from collections.abc import Callable, Iterator

import luigi


def upstream_first(
    *roots: luigi.Task, is_left_out: Callable[[luigi.Task], bool] = lambda _: False
) -> Iterator[luigi.Task]:
    """Yields tasks and everything that they need, each once, and after what it needs.

    Args:
        *roots: The tasks.
        is_left_out: Whether to leave a task out, and what only that task needs. Each task is asked
            about once, before what it needs.
    """
    seen: set[luigi.Task] = set()

    def visit(task: luigi.Task) -> Iterator[luigi.Task]:
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
