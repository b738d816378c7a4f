"""The command of this process: its tasks, its sources, the order of its stages, their outcomes.

Begin with `root_task`, which returns the task that a command requests.
"""
