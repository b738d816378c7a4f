"""The command of this process: the tasks it requests, its sources, and the order of its stages.

Begin with `graph`, which lists all tasks of a command.
"""
