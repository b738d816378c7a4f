import errno
import os
import shutil
import signal
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from expected_failures import refuses
from killing import forked, make
from message_words import mentions

from pipeline import publication
from pipeline.locks import is_held
from pipeline.maintenance.verify import problems
from pipeline.publication import protect, publish
from pipeline.record import Action, ActionRecord
from pipeline.store import FORMAT, Store

POINTS = ["hashed", "synced", "renamed", "placed", "record-written", "linked", "committed"]
ACTION, OTHER = (Action("Word", "code", {"word": word}, {}, {}, {}) for word in "ab")
TOLD = {"label": "Word a", "task": "Word(a)", "started": "2026-01-01", "seconds": 1.0, "log": ""}


def attempt(store: Store, content: bytes = b"content", action: Action = ACTION):
    """Make a directory with one file in a workspace and publish it."""
    with store.workspace(action.key) as workspace:
        out = workspace / "out"
        (out / "deep").mkdir(parents=True)
        (out / "deep" / "file").write_bytes(content)
        return publish(store, out, action, TOLD)


def visible(store: Store) -> bool:
    return store.find(ACTION.key) is not None


def is_whole(store: Store) -> bool:
    return list(problems(store, deep=True)) == []


def killed_at(store: Store, point: str) -> int:
    """Publish in a child process that SIGKILLs itself at the point; returns its wait status."""

    def kill(reached: str) -> None:
        if reached == point:
            os.kill(os.getpid(), signal.SIGKILL)

    return os.waitpid(forked(partial(attempt, Store(store.root, kill))), 0)[1]


def test_published_artifact_is_whole_recorded_and_read_only(store):
    record = attempt(store)
    path = store.object(record.output.digest)
    assert (path / "deep" / "file").read_bytes() == b"content"
    assert store.find(ACTION.key) == record
    assert store.record(ACTION.key).to_json() == record.to_json()
    modes = {p.stat().st_mode & 0o777 for p in (path, path / "deep")}
    assert modes == {0o555}
    assert (path / "deep" / "file").stat().st_mode & 0o777 == 0o444
    assert is_whole(store)
    assert list((store.root / "tmp").iterdir()) == []


@pytest.mark.parametrize("point", POINTS)
def test_sigkill_at_any_point_leaves_all_or_nothing(store, point):
    assert os.WTERMSIG(killed_at(store, point)) == signal.SIGKILL
    assert visible(store) == (point in ("linked", "committed"))
    assert is_whole(store)
    assert attempt(store).output == store.find(ACTION.key).output
    assert is_whole(store)
    left = [path for path in (store.root / "tmp").iterdir() if path.is_dir()]
    assert left == [], "the next build at the key sweeps what the dead one left"


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("call", ["fsync", "rename", "write", "link"])
def test_failing_disk_leaves_nothing_visible(store, monkeypatch, error, call):
    def fail(*_args, **_kwargs):
        raise OSError(error, os.strerror(error))

    owner, name = {
        "fsync": (os, "fsync"),
        "rename": (Path, "rename"),
        "write": (Path, "write_bytes"),
        "link": (Path, "hardlink_to"),
    }[call]
    with store.workspace("0" * 64) as workspace:
        (workspace / "out").mkdir()
        (workspace / "out" / "file").write_bytes(b"content")
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, fail)
            with pytest.raises(OSError, match=os.strerror(error)):
                publish(store, workspace / "out", ACTION, TOLD)
    assert not visible(store)
    assert is_whole(store)
    assert list((store.root / "tmp").iterdir()) == []
    attempt(store)
    assert visible(store)


def test_a_failed_fsync_leaves_nothing_half_visible(store, monkeypatch):
    """The disk fills up at the first, second, ... durable write: nothing is half-visible."""
    real, calls = os.fsync, 0
    for last in range(1, 20):
        calls = 0

        def sometimes(descriptor, last=last):
            nonlocal calls
            calls += 1
            if calls == last:
                raise OSError(errno.ENOSPC, "no space")
            real(descriptor)

        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", sometimes)
            try:
                attempt(store)
            except OSError:
                assert is_whole(store)
                continue
        break
    assert last > 4
    assert visible(store)


def test_the_later_of_two_publications_gets_the_artifact_of_the_first(store):
    winner, loser = attempt(store, b"first"), attempt(store, b"second")
    assert loser == winner
    assert is_whole(store)


@pytest.mark.parametrize("is_before", [True, False])
def test_of_two_publications_that_replace_a_lost_record_one_gives_the_artifact(
    store, monkeypatch, is_before
):
    """Where locks do not work, the other one publishes around the move of the lost record."""
    store.quarantine(store.object(attempt(store, b"lost").output.digest))
    real, theirs = Store.quarantine, []

    def beside_another(mine: Store, path: Path) -> Path:
        monkeypatch.setattr(Store, "quarantine", real)
        if is_before:
            theirs.append(attempt(Store(store.root), b"theirs"))
        moved = real(mine, path)
        if not is_before:
            theirs.append(attempt(Store(store.root), b"theirs"))
        return moved

    monkeypatch.setattr(Store, "quarantine", beside_another)
    assert [attempt(store, b"mine")] == theirs == [store.find(ACTION.key)]
    assert is_whole(store)


def test_equal_content_is_kept_once(store):
    assert attempt(store).output == attempt(store, action=OTHER).output
    assert len(list((store.root / "objects").glob("*/*"))) == 1


@pytest.mark.parametrize(
    "garbage",
    [
        lambda text: b"",
        lambda text: text[: len(text) // 2],
        lambda text: b"\xff\x00garbage",
        lambda text: b"[]",
        lambda text: b"{}",
        lambda text: text.replace(b'"format": 2', b'"format": 3'),
        lambda text: text.replace(b'"family": "Word"', b'"family": "Ward"'),
        lambda text: text.replace(b'"salt": ""', b'"salt": "", "news": 1'),
        lambda text: b"[" * 100_000,
        lambda text: replace(ActionRecord.from_json(text), action=OTHER).to_json(),
    ],
)
def test_a_record_that_is_none_counts_as_absent_and_is_replaced(store, garbage, monkeypatch):
    """A valid record of another key was linked back for ever."""
    record = attempt(store)
    path = store.action(ACTION.key)
    path.chmod(0o644)
    path.write_bytes(garbage(record.to_json()))
    assert store.record(ACTION.key) is None
    assert not is_whole(store)
    calls = ["the only one"]
    monkeypatch.setattr(publication, "_warn_of_change", lambda *_: calls.pop())
    attempt(store)
    assert store.find(ACTION.key).output == record.output
    assert is_whole(store)
    assert len(list((store.root / "quarantine").glob(f"{ACTION.key[:50]}*"))) == 1


def test_a_record_without_its_object_counts_as_absent(store):
    record = attempt(store, b"first")
    store.quarantine(store.object(record.output.digest))
    assert store.record(ACTION.key)
    assert not visible(store)
    assert attempt(store, b"second").output != record.output, "honestly another result"
    assert is_whole(store)


@pytest.mark.parametrize(
    "damage",
    [
        lambda file: file.write_bytes(b"CONTENT"),
        lambda file: file.write_bytes(b"cont"),
        lambda file: file.unlink(),
        lambda file: file.with_name("extra").write_bytes(b""),
    ],
)
def test_a_damaged_object_is_found_and_replaced_by_a_rebuild(store, damage):
    record = attempt(store)
    folder = store.object(record.output.digest) / "deep"
    folder.chmod(0o755)
    (folder / "file").chmod(0o644)
    damage(folder / "file")
    assert not is_whole(store)
    attempt(store)
    assert is_whole(store)
    assert (folder / "file").read_bytes() == b"content"


def test_an_empty_artifact_is_refused(store):
    with store.workspace("0" * 64) as workspace:
        (workspace / "out" / "empty").mkdir(parents=True)
        with refuses("file", kind=ValueError):
            publish(store, workspace / "out", ACTION, TOLD)


def test_a_live_workspace_is_not_swept(store):
    with store.workspace(ACTION.key) as mine, store.workspace(ACTION.key) as other:
        assert mine.exists()
        assert other.exists()


def test_a_store_of_a_newer_program_is_refused(tmp_path):
    Store.open(tmp_path / "new")
    (tmp_path / "new" / "format").write_text("styletrf store 2\n")
    with refuses(tmp_path / "new", "styletrf store 2", FORMAT.strip()):
        Store.open(tmp_path / "new")


def test_a_folder_of_other_things_does_not_become_a_store(tmp_path):
    theirs = tmp_path / "theirs" / "runs" / "2024"
    theirs.mkdir(parents=True)
    with refuses(tmp_path / "theirs"):
        Store.open(tmp_path / "theirs")
    assert list((tmp_path / "theirs").rglob("*")) == [theirs.parent, theirs]
    (tmp_path / "disk" / "lost+found").mkdir(parents=True)
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "format").touch()  # its maker was killed
    for name in ("disk", "disk", "half"):
        assert Store.open(tmp_path / name).object("0" * 64).parents[1].is_dir()


def test_a_store_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with refuses(tmp_path / "file" / "store"):
        Store.open(tmp_path / "file" / "store")


def test_a_rebuild_with_other_bytes_is_reported(store, caplog):
    lost = make(store, "a", "one")
    for content, n_messages in (("one", 0), ("two", 1)):
        caplog.clear()
        shutil.rmtree(store.object(lost.output.digest))
        made = make(store, "a", content)
        assert len(caplog.messages) == n_messages
    (message,) = caplog.messages
    assert message.startswith("a: ")
    assert mentions(message, made.output.digest[:12], lost.output.digest[:12])


def test_a_folder_of_checkpoints_may_vanish_before_it_is_opened(store, tmp_path, monkeypatch):
    """Another build of the key ends between our two calls."""
    real, calls = os.open, []

    def after_another_ended(path, *arguments, **options):
        if Path(path).parent.name == "resume" and not calls:
            calls.append(path)
            Path(path).rmdir()
        return real(path, *arguments, **options)

    monkeypatch.setattr(os, "open", after_another_ended)
    with store.resume("0" * 64, tmp_path) as folder:
        assert folder == store.root / "resume" / ("0" * 64)
        assert folder.is_dir()
    assert calls


def test_what_is_read_only_already_is_not_changed(store, monkeypatch):
    """Another user's object is: only its owner may change its modes."""
    record = attempt(store)

    def not_permitted(path: Path, _mode: int) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM), str(path))

    monkeypatch.setattr(Path, "chmod", not_permitted)
    protect(store.object(record.output.digest))


def test_a_workspace_can_be_opened_by_all_whom_the_umask_lets(store):
    """So that another user of a group sees whether its process lives."""
    before = os.umask(0o002)
    try:
        with store.workspace(ACTION.key) as workspace:
            assert workspace.stat().st_mode & 0o777 == 0o775
            assert is_held(workspace)
    finally:
        os.umask(before)
