"""A content-addressed store under Luigi: what a task makes is kept by what it was made from.

Read in this order: `canonical`, `digest` and `code_identity` (what an artifact *is*), `record`,
`store` and `publication` (where it lies and how it gets there), `execution`, `execute` and `gpu`
(who builds it, on what), `building` (one build from first to last), `task` (what a Luigi task
inherits), `snapshot` and `explanation` (what an edit changes, and why a task would run).
`docs/store.md` states the promises.
"""
