"""A content-addressed store under Luigi: an artifact is found again by what it was made from.

The core stands in this folder. Read `canonical`, `digest` and `record` (what an artifact *is*), then
`store`, `locks`, `publication` and `artifacts` (where it lies, how it gets there and is found), `job`
and `build` (one build from first to last), `artifact_task` (what Luigi asks of a task).

Around it, and unknown to it, are packages: `code` (the identity of a task's code), `execution`
(builds on this machine), `shared_store`, `cluster`, `console` and `maintenance` (`python -m pipeline`).
`task` puts them together: stages derive from its `StoredTask`. `docs/store.md` states the promises.
"""
