"""A content-addressed store under Luigi: an artifact is found again by what it was made from.

The core stands in this folder. Read `canonical`, `digest` and `record` (what an artifact *is*),
then `store`, `locks`, `publication` and `artifacts` (where it lies, how it gets there, how it is
found), `job` and `build` (one build from first to last), `artifact_task` (what Luigi asks of it).

Packages around it, which it does not know: `code` (the identity of a task's code), `execution`
(builds on this machine), `shared_store`, `cluster`, `console`, `maintenance` (`python -m
pipeline`). `task` puts them together: stages derive from its `StoredTask`; `command` is one command
from first to last. `docs/store.md` states the promises.
"""
