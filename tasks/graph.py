"""A task with everything upstream of it."""

import luigi


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
