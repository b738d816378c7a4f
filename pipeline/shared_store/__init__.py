"""A store that machines share: a folder or a bucket, behind the store of each machine.

Enters and leaves: records and artifacts. Nothing from there is believed without its digest.
Begin at `sync.py`. `remote` reads and writes bytes by name, `archive` packs a directory,
`signatures` signs records, and `checkpoints` shares those of builds under way.
"""
