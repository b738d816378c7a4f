"""Looking over a whole store."""

from collections.abc import Iterator

from pipeline.digest import tree_digest
from pipeline.record import ActionRecord
from pipeline.store import Store


def records(store: Store) -> Iterator[ActionRecord]:
    """Every readable record, in the order of the keys."""
    for path in sorted((store.root / "actions").glob("*/*.json")):
        if record := store.record(path.stem):
            yield record


def problems(store: Store, *, deep: bool) -> Iterator[str]:
    """What is wrong with the store, a line each: records that are none, objects gone or altered.

    Args:
        store: The store.
        deep: Read every byte; otherwise only count the files and their sizes.
    """
    for path in sorted((store.root / "actions").glob("*/*.json")):
        if store.record(path.stem) is None:
            yield f"{path}: no valid record"
    for record in records(store):
        path, name = store.object(record.output.digest), record.provenance["label"]
        if not path.is_dir():
            yield f"{path}: the object of {name} is missing"
        elif not store.intact(record) or (deep and not _is_as_recorded(store, record)):
            yield f"{path}: the object of {name} is altered"


def _is_as_recorded(store: Store, record: ActionRecord) -> bool:
    try:
        return tree_digest(store.object(record.output.digest)) == record.output
    except (OSError, ValueError):
        return False
