"""What publication and collection may meet when they are interrupted.

`interruptions` goes through scenarios in an interpreter of its own. They fork thousands of times,
and a fork of a process that has imported torch takes ten times as long.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from killing import (
    Scenario,
    action_of,
    everywhere,
    faulted,
    holds,
    killed,
    living,
    make,
    paused,
    run,
)

from pipeline.maintenance.garbage_collection import collect
from pipeline.maintenance.roots import add_folder_root, pin
from pipeline.store import Store

KEY = action_of("a").key
POINTS = ["hashed", "synced", "renamed", "placed", "record-written", "linked", "committed"]
collect_all = partial(collect, keep_last=0, grace_hours=0, delete=True)


def named(store: Store, *names: str):
    return [record for record in store.records() if record.provenance["label"] in names]


def has(*names: str) -> Callable[[Store], None]:
    """That these artifacts are there, to the last byte."""

    def check(store: Store) -> None:
        assert sorted(record.provenance["label"] for record in named(store, *names)) == [*names]
        assert holds(store, *named(store, *names))

    return check


def has_only(*names: str) -> Callable[[Store], None]:
    """That they are there and nothing else is, nor a trace of anything else."""

    def check(store: Store) -> None:
        has(*names)(store)
        kept = list(store.records())
        assert len(kept) == len(names)
        objects = {path.name for path in (store.root / "objects").glob("*/*")}
        assert objects == {record.output.digest for record in kept}
        for folder in ("tmp", "trash", "quarantine"):
            assert not list((store.root / folder).iterdir()), folder

    return check


# What a publication of "a" may meet.


def damaged(alter: Callable[[Path], object]) -> Callable[[Store], None]:
    """The very object is there, recorded by another action, and damaged."""

    def prepare(store: Store) -> None:
        folder = store.object(make(store, "b", "a").output.digest) / "deep"
        folder.chmod(0o755)
        (folder / "0").chmod(0o644)
        alter(folder / "0")

    return prepare


def misrecorded(garble: Callable[[bytes], bytes]) -> Callable[[Store], None]:
    """The record is there, and is none."""

    def prepare(store: Store) -> None:
        text = make(store, "a").to_json()
        store.action(KEY).chmod(0o644)
        store.action(KEY).write_bytes(garble(text))

    return prepare


def without_object(store: Store) -> None:
    store.quarantine(store.object(make(store, "a").output.digest))


def without_record(store: Store) -> None:
    make(store, "a")
    store.action(KEY).unlink()


def killed_before(point: int) -> Callable[[Store], None]:
    return lambda store: killed(lambda hook: make(Store(store.root, hook), "a"), point)


def reader(*names: str):
    """A living process that found these artifacts, and in the end reads them."""
    return lambda store: living(
        lambda: [store.find(record.action.key) for record in named(store, *names)],
        lambda: has(*names)(store),
    )


def publisher(point: str):
    """A process that publishes the same, and stands still at a point."""
    return lambda store: paused(lambda hook: make(Store(store.root, hook), "a"), point)


Publication = partial(Scenario, act=lambda store: make(store, "a"), expect=has("a"))
PUBLICATIONS = [
    Publication("fresh"),
    Publication("many files", act=lambda store: make(store, "a", files=40)),
    Publication("object there", prepare=lambda store: make(store, "b", "a"), always=has("b")),
    Publication("recorded", prepare=lambda store: make(store, "a", "other"), always=has("a")),
    Publication("record without object", prepare=without_object),
    Publication("object without record", prepare=without_record),
    *(
        Publication(f"object {name}", prepare=damaged(alter), expect=has("a", "b"))
        for name, alter in {
            "flipped": lambda file: file.write_bytes(b"b"),
            "emptied": lambda file: file.write_bytes(b""),
            "deleted": lambda file: file.unlink(),
            "augmented": lambda file: file.with_name("extra").write_bytes(b""),
        }.items()
    ),
    *(
        Publication(f"record {name}", prepare=misrecorded(garble))
        for name, garble in {
            "empty": lambda text: b"",
            "garbage": lambda text: b"\xff\x00garbage",
            "newer": lambda text: json.dumps({**json.loads(text), "format": 3}).encode(),
            "of another key": lambda text: text.replace(b'"Toy"', b'"Tyo"'),
        }.items()
    ),
    *(
        Publication(f"killed before at {point}", prepare=killed_before(number))
        for number, point in enumerate(POINTS)
    ),
    *(
        Publication(f"another at {point}", meanwhile=publisher(point))
        for point in ("synced", "placed", "record-written", "linked")
    ),
    Publication(
        "a reader", prepare=lambda store: make(store, "b", "a"), meanwhile=reader("b"),
        always=has("b"), expect=has("a", "b"),
    ),
]  # fmt: skip


# What a collection may meet.


def rubbish(store: Store) -> None:
    """Four artifacts, one made from another."""
    first = make(store, "rubbish 1")
    make(store, "rubbish 2", inputs=[first])
    make(store, "rubbish 3", files=4)
    make(store, "rubbish 4")


def pinned(store: Store) -> None:
    """A pin on the last of a chain, among rubbish."""
    rubbish(store)
    first = make(store, "first")
    middle = make(store, "middle", inputs=[first])
    pin(store, make(store, "last", inputs=[middle, first]).action.key, "name")


def shown(store: Store) -> None:
    """A folder outside with links into the store, among rubbish."""
    rubbish(store)
    folder = store.root.with_name(f"{store.root.name}-out")
    folder.mkdir()
    target = store.object(make(store, "shown").output.digest) / "deep" / "0"
    add_folder_root(store, folder, [target])
    (folder / "file").symlink_to(target)


def shared(store: Store) -> None:
    """An object that a pinned record and a collected one have in common."""
    make(store, "rubbish", "same")
    pin(store, make(store, "kept", "same").action.key, "name")


def wreckage(store: Store) -> None:
    """What killed publications, and repairs, left."""
    for point, _ in enumerate(POINTS):
        killed(lambda hook: make(Store(store.root, hook), "a", files=3), point)
    store.quarantine(store.object(make(store, "b").output.digest))
    without_record(store)


def collected_before(point: int) -> Callable[[Store], None]:
    def prepare(store: Store) -> None:
        run(lambda: pinned(Store(store.root)))
        assert killed(lambda hook: collect_all(Store(store.root, hook)), point)

    return prepare


def in_use(store: Store) -> None:
    rubbish(store)
    make(store, "used", inputs=[make(store, "source")])


chain = has("first", "last", "middle")
Collection = partial(Scenario, act=collect_all)
COLLECTIONS = [
    Collection("rubbish", prepare=rubbish, expect=has_only()),
    Collection("pinned", prepare=pinned, always=chain, expect=has_only("first", "last", "middle")),
    Collection("shown", prepare=shown, always=has("shown"), expect=has_only("shown")),
    Collection("shared", prepare=shared, always=has("kept"), expect=has_only("kept")),
    Collection("wreckage", prepare=wreckage, expect=has_only()),
    Collection("in use", prepare=in_use, always=has("source", "used"), meanwhile=reader("used")),
    *(
        Collection(f"again after {point}", prepare=collected_before(point), always=chain)
        for point in (1, 5, 12)
    ),
]


INTERRUPTS = {"killed": killed, "faulted": faulted}


def interruptions(
    by: str, scenarios: Iterable[Scenario], folder: Path, file: str = __file__
) -> int:
    """Interrupts scenarios everywhere; returns how often.

    Args:
        by: The name of one of `INTERRUPTS`.
        scenarios: Some of the file's.
        folder: An empty folder for their stores.
        file: The program that calls `main` with its scenarios.
    """
    done = subprocess.run(
        [sys.executable, file, by, folder, *(scenario.name for scenario in scenarios)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return int(done.stdout)


def main(known: Iterable[Scenario]) -> None:
    """Interrupts some of the known scenarios, and prints the number of interruptions."""
    by, folder, *names = sys.argv[1:]
    scenarios = {scenario.name: scenario for scenario in known}
    print(sum(everywhere(scenarios[name], Path(folder), INTERRUPTS[by]) for name in names))  # noqa: T201


if __name__ == "__main__":
    main([*PUBLICATIONS, *COLLECTIONS])
