"""Builds on this machine: their resources, their processes and their costs.

Input: a task and its job. Output: a report of how the build ended.
Begin at `local_executor.py`. It leases GPUs, cores and memory (`gpu`, `cpu_memory`, `host_locks`)
and runs the job in a separate process (`executors`) under a small process that may end it
(`supervisor`). `fork_server` has both forked from a process that has imported the libraries
(`forking_process`), with the variables in `environment`.
`cost_history` records the costs of builds.
"""
