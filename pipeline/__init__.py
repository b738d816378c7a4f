"""A content-addressed store under Luigi, which finds artifacts by a digest of their sources.

The core is in this folder. Read `canonical`, `digest` and `record` (what an artifact *is*), then
`store`, `locks`, `publication` and `artifacts` (where an artifact is, and how it is published and
found), `job` and `build` (one build from start to end), and `artifact_task` (the Luigi task).

The core does not import the packages around it: `code` (the identity of a task's code),
`execution` (builds on this machine), `shared_store`, `cluster`, `console` and `maintenance`
(`python -m pipeline`). `task` combines them, and stages derive from its `StoredTask`. `command`
runs one command from start to end. `docs/store.md` states the promises.
"""
