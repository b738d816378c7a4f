"""`python -m pipeline`: lists and repairs a store, collects garbage, explains why a task would run.

Input: a store. Output: rows for a table, or a store that is repaired or smaller.
Begin at `command_line.py`, which has one subcommand for each function of `commands`,
`store_commands` and `code_commands`.
"""
