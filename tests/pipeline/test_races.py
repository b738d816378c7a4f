"""Several real processes at one store, at the same moment."""

import errno
import fcntl
import os
import random
import signal
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import luigi
import pytest
from killing import Gate, action_of, ended, forked, holds, living, make, paused, run, wrong
from store_toys import built, mark

from pipeline.locks import is_held
from pipeline.maintenance.garbage_collection import collect
from pipeline.settings import current_store
from pipeline.store import Store
from pipeline.task import RunContext, StoredTask

collect_all = partial(collect, keep_last=0, grace_hours=0, delete=True)
KEY = action_of("a").key


class Chance(StoredTask):
    """Every build gives other bytes."""

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        time.sleep(0.1)
        (out / "number").write_bytes(os.urandom(16))


@pytest.fixture
def crowd(tmp_path):
    """Starts `act` in 8 processes at once; gives the lines that each wrote."""

    def start(act) -> list[str]:
        gate = Gate()

        def wait_and_act(number: int) -> None:
            assert gate.wait()
            (tmp_path / f"said.{number}").write_text(str(act()))

        children = [forked(partial(wait_and_act, number)) for number in range(8)]
        gate.open()
        assert [ended(child) for child in children] == [0] * 8
        return [(tmp_path / f"said.{number}").read_text() for number in range(8)]

    return start


@pytest.fixture
def _without_locks():
    config = luigi.configuration.get_config()
    config.set("store", "locks", "false")
    yield
    config.set("store", "locks", "true")


def digest_of_chance() -> str:
    Chance().run()
    return Chance().record().output.digest


@pytest.mark.usefixtures("inline")
def test_eight_processes_at_one_key_are_one_build_and_seven_adoptions(crowd, store):
    digests = crowd(digest_of_chance)
    assert len(built()) == 1
    assert len(digests) - len(built()) == 7
    assert len(set(digests)) == 1
    assert len(list(store.records())) == len(list((store.root / "objects").glob("*/*"))) == 1
    assert not wrong(store)


@pytest.mark.usefixtures("inline", "_without_locks")
def test_eight_processes_without_locks_are_one_record(crowd, store):
    digests = crowd(digest_of_chance)
    assert len(built()) > 1, "nobody waited"
    assert len(set(digests)) == 1, "the losers adopted the winner's"
    assert len(list(store.records())) == 1
    assert not wrong(store)
    assert not list((store.root / "tmp").iterdir())
    collect(store, keep_last=1, grace_hours=0, delete=True)
    assert [path.name for path in (store.root / "objects").glob("*/*")] == digests[:1]


class Checkpointing(StoredTask):
    """Two at once; the second goes on when the first is done, from its own checkpoint."""

    stumbles = luigi.BoolParameter(significant=False)

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        (run.resume / "step").write_text(str(os.getpid()))
        mark(self)
        while len(built()) < 2:
            time.sleep(0.01)
        if (run.resume.parent.name != "resume") and self.wait_for_the_other() and self.stumbles:
            raise RuntimeError("a defect")
        assert (run.resume / "step").read_text() == str(os.getpid())
        (out / "done").touch()

    def wait_for_the_other(self) -> bool:
        while not list(current_store().records()):
            time.sleep(0.01)
        time.sleep(0.2)
        return True


@pytest.mark.usefixtures("inline", "_without_locks")
@pytest.mark.parametrize("stumbles", [False, True])
def test_two_builds_of_one_key_share_no_checkpoint_and_one_record(store, stumbles):
    """Whoever fails where another has the record adopts that."""
    children = [forked(Checkpointing(stumbles).run) for _ in range(2)]
    assert [ended(child) for child in children] == [0, 0]
    assert len(list(store.records())) == 1
    assert not list((store.root / "resume").iterdir())
    assert not list((store.root / "tmp").iterdir())


def test_checkpoints_are_separate_where_nothing_can_be_locked(store, monkeypatch):
    def unsupported(*_words):
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))

    monkeypatch.setattr(fcntl, "flock", unsupported)
    with (
        store.workspace(KEY) as one,
        store.workspace(KEY) as other,
        store.resume(KEY, one) as first,
        store.resume(KEY, other) as second,
    ):
        assert (first.parent, second.parent) == (one, other)


@pytest.mark.usefixtures("inline")
def test_a_holder_killed_while_others_wait_is_succeeded(store, crowd, toys):
    building = Gate()

    def hang() -> None:
        Chance.build = lambda *_args: (building.open(), time.sleep(60))
        Chance().run()

    holder = forked(hang)
    assert building.wait()
    waiters = [forked(digest_of_chance) for _ in range(3)]
    time.sleep(0.3)
    assert not built(), "they wait"
    os.kill(holder, signal.SIGKILL)
    assert ended(holder) == -signal.SIGKILL
    assert [ended(child) for child in waiters] == [0, 0, 0]
    assert len(built()) == 1
    assert not wrong(store)


@pytest.mark.parametrize("point", ["renamed", "placed", "record-written", "linked"])
def test_a_collection_waits_for_a_publication_and_spares_it(store, point):
    with paused(lambda hook: make(Store(store.root, hook), "a"), point):
        child = forked(lambda: collect_all(Store(store.root)))
        time.sleep(0.2)
        assert os.waitpid(child, os.WNOHANG) == (0, 0), "it waits"
    assert ended(child) == 0
    assert not wrong(store)


def test_what_a_living_process_published_stays_with_all_it_was_made_from(store):
    def publish() -> None:
        source = make(mine, "source")
        make(mine, "a", inputs=[source])

    def still_there() -> None:
        assert holds(mine, *mine.records())
        assert len(list(mine.records())) == 2

    mine = Store(store.root)
    with living(publish, still_there):
        run(lambda: collect_all(Store(store.root)))
        assert holds(store, *store.records())
        assert len(list(store.records())) == 2
    run(lambda: collect_all(Store(store.root)))
    assert not list(store.records())
    assert not list((store.root / "objects").glob("*/*"))


def test_who_looks_during_a_collection_waits_and_then_finds_nothing_or_keeps_it(store):
    run(lambda: make(Store(store.root), "a"))
    with paused(lambda hook: collect_all(Store(store.root, hook)), "trashed"):
        child = forked(lambda: os._exit(7 if Store(store.root).find(KEY) is None else 0))
        time.sleep(0.2)
        assert os.waitpid(child, os.WNOHANG) == (0, 0), "it waits"
    assert ended(child) == 7
    run(lambda: make(Store(store.root), "a"))
    assert not wrong(store)


def test_nobody_waits_for_the_trash_to_be_emptied(store):
    run(lambda: make(Store(store.root), "a"))
    with paused(lambda hook: collect_all(Store(store.root, hook)), "released"):
        run(lambda: make(Store(store.root), "a"))
    assert store.record(KEY)
    assert not wrong(store)


def test_a_worker_forked_from_a_process_keeps_its_lease(store):
    """As Luigi's workers do, when their parent is killed."""
    run(lambda: make(Store(store.root), "a"))
    ready, go = Gate(), Gate()

    def parent() -> None:
        mine = Store(store.root)
        mine.find(KEY)
        forked(lambda: (ready.open(), go.wait()))
        time.sleep(60)

    child = forked(parent)
    assert ready.wait()
    os.kill(child, signal.SIGKILL)
    ended(child)
    run(lambda: collect_all(Store(store.root)))
    assert store.record(KEY)
    go.open()
    (lease,) = (store.root / "runs").iterdir()
    while is_held(lease):
        time.sleep(0.01)
    run(lambda: collect_all(Store(store.root)))
    assert not store.record(KEY)


def test_collections_at_the_same_time_leave_nothing(store, crowd):
    def litter() -> None:
        mine = Store(store.root)
        for number in range(30):
            make(mine, f"rubbish {number}")

    run(litter)
    crowd(lambda: collect_all(Store(store.root)))
    for folder in ("objects/*/*", "actions/*/*", "trash/*"):
        assert not list(store.root.glob(folder))


def test_what_was_found_stays_readable_beside_collectors(store):
    """To the last byte, as long as the process lives that has found it."""
    until = time.monotonic() + 1

    def use(seed: int) -> None:
        chance = random.Random(seed)
        while time.monotonic() < until:
            run(partial(use_a_few, chance.random()))

    def use_a_few(seed: float) -> None:
        mine, chance = Store(store.root), random.Random(seed)
        names = [str(chance.randrange(8)) for _ in range(4)]
        found = [mine.find(action_of(name).key) or make(mine, name) for name in names]
        found.append(make(mine, "sum", inputs=found))
        assert holds(mine, *found)

    def sweep() -> None:
        while time.monotonic() < until:
            run(lambda: collect_all(Store(store.root)))

    users = [forked(partial(use, seed)) for seed in range(4)]
    sweepers = [forked(sweep) for _ in range(2)]
    assert [ended(child) for child in users + sweepers] == [0] * 6
    assert not wrong(store)
    run(lambda: collect_all(Store(store.root)))
    assert not list((store.root / "objects").glob("*/*"))
