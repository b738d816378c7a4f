"""A store that machines share: runs, the commands, and two at a time."""

import errno
import os
import time
from pathlib import Path

import luigi
import pytest
from commands import start
from killing import Gate, ended, forked, make
from message_words import mentions
from sharing_cases import build, command, is_whole, objects
from store_toys import Sentence, Word, built

from pipeline.code.closure import load_closure
from pipeline.errors import StoreError
from pipeline.settings import current_store
from pipeline.shared_store.remote import Remote
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.sync import SharedArtifacts, pull, push, shared_record
from pipeline.store import Store
from pipeline.task import artifact

MEBIBYTE = 2**20

# A run.


@pytest.mark.usefixtures("inline")
def test_another_machine_builds_nothing_and_fetches_only_what_it_reads(shared, elsewhere):
    assert build(Sentence())
    assert len(shared.names("objects")) == len(shared.names("actions")) == 3
    before, here = built(), artifact(Sentence())
    there = elsewhere()
    assert Sentence().complete()
    assert build(Sentence())
    assert built() == before
    assert objects(there) == [], "complete without the bytes"
    fetched = artifact(Sentence())
    assert fetched.is_relative_to(there.root)
    assert (fetched / "sentence.txt").read_text() == "hello world"
    assert fetched.name == here.name
    assert len(objects(there)) == 1
    assert build(Sentence(("hello", "moon")))
    assert sorted(set(built()) - set(before)) == ["Word moon"]
    assert built().count("Word hello") == 1, "its object was fetched for the new sentence"
    assert is_whole(there)


@pytest.mark.usefixtures("inline")
def test_another_machine_reports_which_function_differs(shared, elsewhere):
    build(Word("hello"))
    (code,) = shared.names("code")
    record = Word("hello").record()
    members = load_closure(str(record.provenance["closure"]), current_store())
    there = elsewhere()
    assert Word("hello").complete()
    assert members
    assert load_closure(str(record.provenance["closure"]), there) == members
    assert Path(code).stem == record.provenance["closure"]


@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("garbage", [b"", b"{", b'{"a": "b"}', b'{"@a": 1}', b"[" * 100_000])
def test_shared_code_that_is_garbage_is_passed_over(shared, elsewhere, garbage):
    build(Word("hello"))
    closure = str(Word("hello").record().provenance["closure"])
    shared.write(f"code/{closure[:2]}/{closure}.json", garbage)
    there = elsewhere()
    assert Word("hello").complete()
    assert load_closure(closure, there) is None


@pytest.mark.parametrize(
    ("shared", "workers"), [("directory", "2"), ("s3", "1"), ("s3", "2")], indirect=["shared"]
)
def test_a_command_finds_what_one_on_another_machine_built(shared, elsewhere, workers):
    def run() -> str:
        process = start("luigi", "--module", "toys", "Sentence", "--workers", workers)
        screen = "".join(process.communicate(timeout=60))
        assert process.returncode == 0, screen
        return screen

    assert "Sentence: done" in run()
    elsewhere()
    screen = run()
    assert screen.index("=====") < 3, "there was nothing to do and nothing to say"
    assert len(built()) == 3


@pytest.mark.usefixtures("inline")
def test_what_was_collected_here_is_fetched_again(shared, store):
    build(Word("hello"), Word("world"))
    store.quarantine(artifact(Word("hello")))
    luigi.task_register.Register.clear_instance_cache()
    assert Word("hello").complete()
    assert is_whole(store), "an object that the shared store has is not missing"
    assert build(Sentence())
    assert built().count("Word hello") == 1


# The commands.


@pytest.mark.usefixtures("inline", "_unshared")
def test_push_and_pull_round_trip(shared, elsewhere, capsys):
    build(Sentence())
    here = current_store()
    assert shared.names() == []
    status, rows = command(capsys, "push")
    assert (status, {row["done"] for row in rows}) == (0, {"pushed"})
    assert sorted(row["label"] for row in rows) == ["Sentence", "Word hello", "Word world"]
    assert command(capsys, "push") == (0, [])
    key = Sentence().action().key
    shared.remove(f"actions/{key[:2]}/{key}.json")
    status, rows = command(capsys, "push")
    assert (status, [row["label"] for row in rows]) == (0, ["Sentence"]), "only what lacks"
    there = elsewhere()
    status, rows = command(capsys, "pull", key[:12])
    assert (status, [row["done"] for row in rows]) == (0, ["fetched"])
    assert len(objects(there)) == 1
    status, rows = command(capsys, "pull", objects(there)[0][:9], "--closure")
    assert (status, sorted(row["label"] for row in rows)) == (0, ["Word hello", "Word world"])
    assert objects(there) == objects(here)
    assert [r.to_json() for r in there.records()] == [r.to_json() for r in here.records()]
    assert command(capsys, "pull", key, "--closure") == (0, [])
    assert command(capsys, "pull", "xyz")[0] == 2
    assert is_whole(there)


@pytest.mark.usefixtures("_unshared")
def test_push_of_what_is_damaged_is_refused(shared, store, capsys):
    record = make(store, "a", "text")
    file = store.object(record.output.digest) / "deep" / "0"
    file.chmod(0o644)
    file.write_text("tixt")
    status, rows = command(capsys, "push")
    assert (status, rows[0]["done"]) == (1, "is missing or damaged here")
    assert shared.names() == []


def test_the_archive_of_equal_content_is_equal(shared, store, tmp_path):
    push(store, make(store, "a", "same"), current_remote())
    (name,) = shared.names("objects")
    first = shared.read(name)
    other = Store.open(tmp_path / "other")
    record = make(other, "b", "same")
    os.utime(other.object(record.output.digest) / "deep" / "0", (1, 1))
    shared.remove(name)
    push(other, record, current_remote())
    assert shared.read(name) == first


# Two at a time.


@pytest.mark.parametrize("content", ["same", "another"])
def test_of_two_pushers_one_gives_the_record(shared, store, tmp_path, content):
    """Both found nothing there, and upload at once; the slower replaces nothing."""
    other = Store.open(tmp_path / "other")
    mine, theirs = make(store, "a", "same"), make(other, "a", content)
    ready, go = [Gate(), Gate()], Gate()

    def run(root: Path, gate: Gate) -> None:
        def reached(point: str) -> None:
            if point == "push-packed":
                gate.open()
                assert go.wait()

        push(Store(root, reached), mine if root == store.root else theirs, current_remote())

    children = [
        forked(lambda root=root, gate=gate: run(root, gate))
        for root, gate in zip((store.root, other.root), ready, strict=True)
    ]
    assert all(gate.wait() for gate in ready)
    go.open()
    assert [ended(child) for child in children] == [0, 0]
    assert len(shared.names("actions")) == 1
    assert len(shared.names("objects")) == len({mine.output, theirs.output})
    winner = shared_record(current_remote(), mine.action.key)
    assert winner in (mine, theirs)
    reader = Store.open(tmp_path / "reader")
    assert SharedArtifacts(reader).lookup(mine.action.key) == winner
    assert pull(reader, winner, current_remote()) == "fetched"
    assert is_whole(reader)


def test_of_many_readers_one_downloads_and_none_takes_that_for_a_loss(
    shared, store, tmp_path, monkeypatch
):
    record = make(store, "a", "text")
    push(store, record, current_remote())
    there, download = Store.open(tmp_path / "there"), Remote.download

    def slowly(remote: Remote, name: str, target: Path) -> None:
        (tmp_path / f"downloaded.{os.getpid()}").touch()
        time.sleep(0.3)
        download(remote, name, target)

    monkeypatch.setattr(Remote, "download", slowly)

    def read() -> None:
        assert SharedArtifacts(Store(there.root)).fetch(record)

    assert [ended(child) for child in [forked(read) for _ in range(4)]] == [0] * 4
    assert len(list(tmp_path.glob("downloaded.*"))) == 1
    assert not list((there.root / "quarantine").iterdir())


def test_what_another_fetched_meanwhile_is_no_loss(shared, store, tmp_path, monkeypatch):
    record = make(store, "a", "text")
    push(store, record, current_remote())
    there = Store.open(tmp_path / "there")

    def slower(*arguments) -> str:
        pull(*arguments)
        return pull(*arguments)

    monkeypatch.setattr("pipeline.shared_store.sync.pull", slower)
    assert SharedArtifacts(there).fetch(record)
    assert not list((there.root / "quarantine").iterdir())


@pytest.mark.parametrize("full", ["download", "unpack"])
def test_our_own_full_disk_is_not_the_shared_stores_failure(
    shared, store, tmp_path, monkeypatch, caplog, full
):
    record = make(store, "a", "text")
    push(store, record, current_remote())
    there, download = Store.open(tmp_path / "there"), Remote.download
    if full == "download":
        to_full = lambda remote, name, target: download(remote, name, Path("/dev/full"))  # noqa: E731
        monkeypatch.setattr(Remote, "download", to_full)
    else:
        failing = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        monkeypatch.setattr(
            "pipeline.shared_store.sync.unpack", lambda *_arguments: raising(failing)
        )
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)) as failure:
        SharedArtifacts(there).fetch(record)
    assert failure.value.errno == errno.ENOSPC
    assert not list((there.root / "quarantine").iterdir())
    assert not caplog.messages


def raising(error: Exception) -> None:
    raise error


def test_a_failure_is_reported_in_sentences(caplog):
    def fail(_remote: Remote) -> None:
        raise StoreError("it is away")

    Remote("/nowhere").call_or_none("reading", fail)
    (message,) = caplog.messages
    assert message.startswith("it is away. ")
    assert mentions(message, "reading")
    assert message.endswith(".")


@pytest.mark.parametrize(
    ("shared", "size"),
    [("directory", 10), ("s3", 10), pytest.param("s3", 11 * MEBIBYTE, id="s3 in parts")],
    indirect=["shared"],
)
def test_what_is_there_is_never_replaced(shared, tmp_path, monkeypatch, size):
    """Also what is uploaded in parts, here of the smallest size that S3 allows."""
    monkeypatch.setattr("s3fs.core.calculate_chunksize", lambda *_, **__: 5 * MEBIBYTE)
    first, second = tmp_path / "first", tmp_path / "second"
    for path, letter in ((first, b"a"), (second, b"b")):
        with path.open("wb") as file:
            file.write(letter)
            file.truncate(size)
    remote = current_remote()
    assert remote.create("objects/x.tar", first)
    assert not remote.create("objects/x.tar", second)
    remote.download("objects/x.tar", tmp_path / "back")
    assert (tmp_path / "back").read_bytes() == first.read_bytes()
