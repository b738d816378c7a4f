"""Artifacts of processes that are gone, and what is there of them."""

from functools import partial

from killing import make, run

from pipeline.maintenance.garbage_collection import collect
from pipeline.record import ActionRecord
from pipeline.store import Store

collect_all = partial(collect, keep_last=0, grace_hours=0, delete=True)
"""Deletes all that nothing uses, however young it is."""


def made(store: Store, *arguments, **options) -> ActionRecord:
    """An artifact of a process that is gone."""
    run(lambda: make(Store(store.root), *arguments, **options))
    return next(r for r in store.records() if r.provenance["label"] == arguments[0])


def used(store: Store, *found: ActionRecord) -> None:
    """A run that finds these artifacts, and ends."""
    run(lambda: [*map(Store(store.root).find, (record.action.key for record in found))])


def names(store: Store) -> list[str]:
    """The labels of all artifacts that are there."""
    return sorted(str(record.provenance["label"]) for record in store.records())
