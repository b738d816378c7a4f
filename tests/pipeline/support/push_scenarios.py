"""What a push to a shared folder may meet when it is interrupted, see `crash_scenarios`."""

import contextlib
import os
from pathlib import Path

from crash_scenarios import main
from killing import Scenario, make

from pipeline.maintenance.verify import problems
from pipeline.shared_store.remote import Remote
from pipeline.shared_store.sync import pull, push, shared_record
from pipeline.store import Store


def part(store: Store) -> Remote:
    """The store's own part of the shared store."""
    remote = Remote(f"{os.environ['STYLETRF_REMOTE']}/{store.root.name}", reached=store.reached)
    with contextlib.suppress(OSError):
        Path(remote.url).mkdir()
    return remote


def give(store: Store) -> None:
    for record in store.records():
        push(store, record, part(store))


def is_believable(store: Store) -> None:
    remote, reader = part(store), Store.open(store.root.with_name(f"{store.root.name}-reader"))
    for record in store.records():
        if found := shared_record(remote, record.action.key):
            assert found == record
            assert pull(reader, found, remote) in ("fetched", "is here")
    assert not list(problems(reader, deep=True))


def is_complete(store: Store) -> None:
    assert all(shared_record(part(store), record.action.key) for record in store.records())


def one(store: Store) -> None:
    make(store, "a")


def three(store: Store) -> None:
    one(store)
    make(store, "b", "same", files=4)
    make(store, "c", "same", files=4)


def partly(store: Store) -> None:
    """Records without their objects are in the folder."""
    three(store)
    push(store, next(store.records()), part(store))
    files = [file for file in Path(part(store).url, "objects").rglob("*") if file.is_file()]
    assert files
    for file in files:
        file.unlink()


ONE, THREE, PARTLY = (
    Scenario(prepare.__name__, give, prepare, is_believable, is_complete)
    for prepare in (one, three, partly)
)


if __name__ == "__main__":
    main([THREE, PARTLY])
