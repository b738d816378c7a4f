"""Builds on several machines: Ray and SLURM clusters, and commands that share one luigid.

Enters: a task that is to be built, its action and the store. Leaves: the record of its artifact,
which a node of the cluster built into a store that both machines share.
Begin at `submission.py`. On the node, `job_runner.py` runs an ordinary build. `luigid.py` is for
commands that each build on their own machine and agree on the work through luigid.
"""
