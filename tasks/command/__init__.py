"""The command of this process: the tasks it requests, its sources, and actions at its end.

Begin with `graph`, which lists all tasks of a command.
"""
