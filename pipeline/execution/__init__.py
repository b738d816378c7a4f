"""Builds on this machine: what they may use, how they run, and what they cost.

Enters: a task and its job. Leaves: a report of how the build ended.
Begin at `local_executor.py`. It leases GPUs, cores and memory (`gpu`, `cpu_memory`, `host_locks`)
and runs the job in a process of its own (`executors`) under a small process that may end it
(`supervisor`). `fork_server` forks both from one that has imported the libraries.
`cost_history` records what builds took.
"""
