"""The command of this process: its tasks, its sources, the order of its stages, their outcomes.

Enters: the command line that Luigi has parsed, and the store. Leaves: the task that was requested,
its sources, the seconds from each stage to the end, and what became of each result.
Begin with `root_task`, which returns the task that a command requests.
"""
