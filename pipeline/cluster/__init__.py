"""Builds on several machines: Ray and SLURM clusters, and commands that share one luigid.

Input: a task to build, its action and the store. Output: the record of its artifact, which a node
of the cluster built into a store that both machines share.
Begin at `submission.py`. On the node, `job_runner.py` runs an ordinary build. `luigid.py` is for
commands that build on their own machines and share the work through luigid.
"""
