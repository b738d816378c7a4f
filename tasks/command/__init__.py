"""The command of this process: the tasks it requests, its sources, and the order of its stages.

Begin with `root_task`, which returns the task that a command requests.
"""
