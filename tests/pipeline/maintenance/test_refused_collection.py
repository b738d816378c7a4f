"""Garbage collection where a disk or other users refuse something."""

import errno
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from collection_cases import collect_all, made, names
from killing import action_of, ended, forked, make
from message_words import mentions

from pipeline.maintenance.garbage_collection import collect
from pipeline.store import Store

NOBODY = 65534


def as_nobody(act) -> int:
    """Run `act` in a process without the rights of root; returns its exit status."""

    def drop_rights_and_act() -> None:
        if os.geteuid() == 0:
            os.setgroups([])
            os.setuid(NOBODY)
        act()

    return ended(forked(drop_rights_and_act))


@pytest.fixture
def public():
    """A folder that anybody may reach, of nobody's own."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        if os.geteuid() == 0:
            os.chown(folder, NOBODY, NOBODY)
        yield Path(folder)
        for path, _, _ in os.walk(folder):
            Path(path).chmod(0o700)


def test_read_only_artifacts_are_deleted_without_the_rights_of_root(public):
    assert as_nobody(lambda: make(Store.open(public / "store"), "a", files=3)) == 0
    assert as_nobody(lambda: collect_all(Store.open(public / "store"))) == 0
    for pattern in ("objects/*/*", "trash/*", "actions/*/*"):
        assert not list((public / "store").glob(pattern))


def test_a_store_that_can_only_be_read_is_read(public):
    assert as_nobody(lambda: make(Store.open(public / "store"), "a")) == 0

    def read() -> None:
        store = Store.open(public / "store")
        assert store.find(action_of("a").key)
        assert store.find("0" * 64) is None
        assert [v.what for v in collect(store, keep_last=0, grace_hours=0) if v.delete]

    for path in [public / "store", *(public / "store").rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = sorted((public / "store").rglob("*"))
    assert as_nobody(read) == 0
    assert sorted((public / "store").rglob("*")) == before
    assert as_nobody(lambda: make(Store.open(public / "store"), "b")) != 0


def test_a_full_disk_is_freed(store, monkeypatch):
    """Nothing can be made there, not even a folder; what is there can be renamed and deleted."""
    record = made(store, "a")

    def full(*_words: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as disk:
        disk.setattr(os, "mkdir", full)
        collect_all(store)
    assert names(store) == []
    assert not store.object(record.output.digest).exists()
    assert not list((store.root / "trash").iterdir())


def test_what_was_moved_before_the_disk_failed_is_deleted(store, monkeypatch):
    """A full disk has no room for the names of all garbage, until some of it is deleted."""
    for name in "abc":
        made(store, name)
    set_aside, calls = Store.set_aside, []

    def once(mine: Store, path: Path, folder: str) -> Path:
        calls.append(path)
        if len(calls) > 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return set_aside(mine, path, folder)

    monkeypatch.setattr(Store, "set_aside", once)
    for left in (2, 1):  # one more record goes each time
        calls.clear()
        with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
            collect_all(store)
        assert not list((store.root / "trash").iterdir())
        assert len(names(store)) == left


def test_what_may_not_be_moved_stays_and_the_other_garbage_goes(store, monkeypatch, caplog):
    objects = [store.object(made(store, name).output.digest) for name in "abc"]
    (foreign, *own), rename = sorted(objects), Path.rename

    def refused(path: Path, target: Path) -> Path:
        if path == foreign:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refused)
    (stays,) = (decision for decision in collect_all(store) if not decision.delete)
    assert stays.path == foreign
    assert foreign.exists()
    assert not any(path.exists() for path in own)
    assert names(store) == []
    assert [mentions(warned.message, "1", "own") for warned in caplog.records] == [True]


def test_a_record_that_may_not_be_moved_keeps_its_artifact(store, monkeypatch):
    kept, *gone = (made(store, name) for name in "abc")
    rename = Path.rename

    def refused(path: Path, target: Path) -> Path:
        if path == store.action(kept.action.key):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refused)
    collect_all(store)
    assert store.find(kept.action.key) == kept
    assert not any(store.object(record.output.digest).exists() for record in gone)


@pytest.mark.skipif(os.geteuid() != 0, reason="wants root, who can become two users")
def test_in_the_store_of_a_group_each_user_collects_what_is_theirs(public):
    public.chmod(0o777)
    owners = {"a": 1001, "b": 1002}

    def as_user(user: int, act: Callable[[], object]) -> int:
        def become_user_and_act() -> None:
            os.umask(0o002)
            os.setgroups([])
            os.setuid(user)
            act()

        return ended(forked(become_user_and_act))

    def objects() -> set[int]:
        return {path.stat().st_uid for path in (public / "store" / "objects").glob("*/*")}

    for name, user in owners.items():
        assert as_user(user, lambda name=name: make(Store.open(public / "store"), name)) == 0
    assert objects() == {1001, 1002}
    assert as_user(1002, lambda: collect_all(Store.open(public / "store"))) == 0
    assert objects() == {1001}
    assert as_user(1001, lambda: collect_all(Store.open(public / "store"))) == 0
    assert not list((public / "store").glob("actions/*/*"))
    assert objects() == set()


def test_a_workspace_of_another_user_that_cannot_be_opened_stops_nobody(public):
    """A killed build leaves it in a store that a group may write."""
    key = action_of("a").key

    def build_and_collect() -> None:
        store = Store.open(public / "store")
        (store.root / "tmp" / f"{key}-left").mkdir(mode=0)
        make(store, "a")
        collect(store, delete=True)
        assert names(store) == ["a"]

    assert as_nobody(build_and_collect) == 0
