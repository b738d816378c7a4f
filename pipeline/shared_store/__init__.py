"""A store that machines share: a folder or a bucket, behind the store of each machine.

Input and output: records and artifacts. The digest of every artifact is checked.
Begin at `sync.py`. `remote` reads and writes bytes by name, `archive` packs a directory,
`signatures` signs records, and `checkpoints` shares the checkpoints of running builds.
"""
