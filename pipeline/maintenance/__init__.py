"""`python -m pipeline`: what a store holds, why a task would run, repair and garbage collection.

Enters: a store. Leaves: rows for a table, or a store that is repaired or smaller.
Begin at `command_line.py`, which has one subcommand for each function of `commands`,
`store_commands` and `code_commands`.
"""
