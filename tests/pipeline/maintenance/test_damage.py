"""Every kind of damage is found, by `verify --deep` and by whoever reads, and made good again."""

import dataclasses
import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import luigi
import pytest
from expected_failures import fails, refuses
from killing import make
from message_words import mentions
from store_toys import Sentence, Word, built, mark

from pipeline.errors import StoreError
from pipeline.maintenance.command_line import main
from pipeline.maintenance.verify import problems
from pipeline.record import ActionRecord
from pipeline.shared_store.remote import Remote, open_remote
from pipeline.shared_store.settings import current_remote
from pipeline.shared_store.sync import push
from pipeline.store import Store
from pipeline.task import RunContext, StoredTask, artifact

pytestmark = pytest.mark.usefixtures("inline")


def flip(folder: Path) -> None:
    """The same length, one bit off."""
    (folder / "word.txt").write_bytes(b"hellp")


def append(folder: Path) -> None:
    (folder / "word.txt").write_bytes(b"hello ")


def truncate(folder: Path) -> None:
    (folder / "word.txt").write_bytes(b"hell")


def delete(folder: Path) -> None:
    (folder / "word.txt").unlink()


def add(folder: Path) -> None:
    (folder / "extra").write_bytes(b"")


def add_folder(folder: Path) -> None:
    (folder / "extra").mkdir()


def rename(folder: Path) -> None:
    (folder / "word.txt").rename(folder / "ward.txt")


def swap_for_a_link(folder: Path) -> None:
    """A link to the very bytes."""
    (folder / "word.txt").rename(folder.parents[2] / "moved.txt")
    (folder / "word.txt").symlink_to(folder.parents[2] / "moved.txt")


def remove_all(folder: Path) -> None:
    shutil.rmtree(folder)


def become_a_file(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_bytes(b"hello")


def stay_writable(_folder: Path) -> None:
    """The right bytes, open to accidents."""


ALTERATIONS = [flip, append, truncate, delete, add, add_folder, rename, swap_for_a_link]
KINDS: Mapping[Callable[[Path], None], str] = {
    **dict.fromkeys([*ALTERATIONS, become_a_file], "altered"),
    remove_all: "missing",
    stay_writable: "writable",
}
every_kind = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
# A bucket knows nothing of the damage here: one kind of each class tells what it would restore.
OVER_THERE = [("directory", kind) for kind in KINDS]
OVER_THERE += [("s3", kind) for kind in (flip, remove_all, stay_writable)]
every_kind_and_store = pytest.mark.parametrize(
    ("shared", "kind"),
    OVER_THERE,
    indirect=["shared"],
    ids=[f"{store}-{kind.__name__}" for store, kind in OVER_THERE],
)


@pytest.fixture
def word() -> ActionRecord:
    """The record of a word that was built."""
    assert build(Word("hello"), Word("world"))
    record = Word("hello").record()
    assert record
    luigi.task_register.Register.clear_instance_cache()
    return record


def build(*tasks: luigi.Task) -> bool:
    return luigi.build(tasks, local_scheduler=True, logging_conf_file="")


def damage(store: Store, record: ActionRecord, kind: Callable[[Path], None]) -> Path:
    """Do it, as root or a failing disk does."""
    folder = store.object(record.output.digest)
    folder.chmod(0o755)
    (folder / "word.txt").chmod(0o644)
    kind(folder)
    if kind is not stay_writable and folder.is_dir():
        for path in (*folder.iterdir(), folder):
            path.chmod(0o555 if path.is_dir() else 0o444)
    return folder


def verify(capsys, *arguments: str) -> tuple[int, list[dict[str, str]]]:
    capsys.readouterr()
    status = main(["verify", "--json", *arguments])
    return status, json.loads(capsys.readouterr().out)


def is_right(store: Store, record: ActionRecord) -> bool:
    file = store.object(record.output.digest) / "word.txt"
    return (
        file.read_bytes() == b"hello"
        and file.stat().st_mode & 0o777 == 0o444
        and not list(problems(store, deep=True))
    )


@every_kind
def test_verify_finds_every_kind_of_damage(store, word, kind, capsys):
    assert verify(capsys, "--deep") == (0, [])
    folder = damage(store, word, kind)
    status, rows = verify(capsys, "--deep")
    assert status == 1
    assert [row["found"] for row in rows] == [KINDS[kind]]
    assert (rows[0]["path"], rows[0]["what"]) == (str(folder), "Word hello")
    if kind in (flip, rename, add_folder):
        assert verify(capsys) == (0, []), "only a look at every byte tells"
    else:
        assert verify(capsys)[0] == 1


@every_kind
def test_a_reader_finds_damage_and_its_run_makes_the_artifact_again(store, word, kind):
    """Also a rebuild: nothing is shared."""
    damage(store, word, kind)
    assert build(Sentence())
    assert (artifact(Sentence()) / "sentence.txt").read_text() == "hello world"
    assert built().count("Word hello") == (1 if kind is stay_writable else 2)
    assert is_right(store, word)


@every_kind
def test_an_artifact_whose_damage_shows_is_not_complete(store, word, kind):
    """What same sizes hide is the reader's to find: to look at every byte here would take hours."""
    damage(store, word, kind)
    seen = kind not in (flip, rename, add_folder, stay_writable)
    assert Word("hello").complete() is not seen
    assert build(Word("hello"))
    assert built().count("Word hello") == 1 + seen
    assert not seen or is_right(store, word)


@every_kind_and_store
def test_the_reader_restores_it_from_the_shared_store(store, shared, word, kind):
    damage(store, word, kind)
    assert build(Sentence())
    assert (artifact(Sentence()) / "sentence.txt").read_text() == "hello world"
    assert built().count("Word hello") == 1
    assert is_right(store, word)


@every_kind_and_store
def test_repair_restores_it_from_the_shared_store(store, shared, word, kind, capsys):
    damage(store, word, kind)
    status, rows = verify(capsys, "--deep", "--repair")
    done = {"writable": "protected"}.get(KINDS[kind], "restored from the shared store")
    expected = [] if kind is remove_all else [(KINDS[kind], done)]  # there, it is not missing
    assert (status, [(row["found"], row["done"]) for row in rows]) == (0, expected)
    assert kind is remove_all or is_right(store, word)
    assert verify(capsys, "--deep") == (0, [])
    assert artifact(Word("hello"))
    assert is_right(store, word)
    assert built().count("Word hello") == 1


@every_kind
def test_repair_without_another_copy_lets_the_next_run_make_it_again(store, word, kind, capsys):
    damage(store, word, kind)
    status, rows = verify(capsys, "--deep", "--repair")
    assert (status, len(rows)) == (0, 1)
    assert verify(capsys, "--deep") == (0, [])
    assert Word("hello").complete() == (kind is stay_writable)
    assert build(Sentence())
    assert is_right(store, word)


@every_kind_and_store
def test_damage_is_not_given_away(store, shared, monkeypatch, kind, capsys):
    monkeypatch.setenv("STYLETRF_REMOTE", "")
    assert build(Word("hello"))
    (record,) = store.records()
    monkeypatch.setenv("STYLETRF_REMOTE", shared.url)
    damage(store, record, kind)
    said = push(store, record, current_remote())
    assert (said == "pushed") == (kind is stay_writable)
    assert bool(shared.names("objects")) == (kind is stay_writable)


def test_two_records_of_one_damaged_object_are_both_repaired(store, shared, capsys):
    one, two = make(store, "one", "same"), make(store, "two", "same")
    push(store, one, current_remote())
    file = store.object(one.output.digest) / "deep" / "0"
    file.chmod(0o644)
    file.write_text("sama")
    status, rows = verify(capsys, "--deep", "--repair")
    assert (status, len(rows)) == (0, 1)
    assert store.find(two.action.key) == two
    assert verify(capsys, "--deep") == (0, [])


@pytest.mark.parametrize("is_shared", [True, False])
def test_a_record_that_is_none_is_restored_or_set_aside(store, shared, word, is_shared, capsys):
    path = store.action(word.action.key)
    path.chmod(0o644)
    path.write_text("{}")
    if not is_shared:
        shared.remove(*shared.names("actions"))
    status, rows = verify(capsys, "--repair")
    assert (status, rows[0]["found"]) == (0, "no record")
    assert (store.record(word.action.key) == word) == is_shared
    garbage = [] if is_shared else ["garbage, for gc"]
    assert [row["found"] for row in rows[1:]] == garbage
    assert Word("hello").complete() == is_shared
    assert build(Word("hello"))
    assert verify(capsys, "--deep") == (0, [])


def test_no_byte_of_a_record_can_change_unnoticed(store):
    made = make(store, "a")
    text = made.to_json()
    for place in range(len(text)):
        for byte in {text[place] ^ 1, text[place] ^ 16, *b'0 "'} - {text[place]}:
            try:
                read = ActionRecord.from_json(bytes([*text[:place], byte, *text[place + 1 :]]))
            except ValueError:
                continue
            assert read == made


@pytest.mark.parametrize("field", ["size", "files", "digest", "label"])
def test_an_altered_record_is_the_records_fault(store, word, field, capsys):
    path = store.action(word.action.key)
    fields = json.loads(path.read_text())
    part = fields["provenance" if field == "label" else "output"]
    other = Word("world").record().output.digest
    part[field] = other if field == "digest" else f"{part[field]}1"
    path.chmod(0o644)
    path.write_text(json.dumps(fields))
    assert verify(capsys, "--repair")[1][0]["found"] == "no record"
    assert store.object(word.output.digest).is_dir()
    assert store.record(word.action.key) is None
    assert build(Word("hello"))
    assert is_right(store, word)


def test_a_record_without_provenance_is_none(store):
    record = dataclasses.replace(make(store, "a"), provenance={})
    with refuses(kind=ValueError):
        ActionRecord.from_json(record.to_json())


def test_garbage_is_reported_and_is_no_damage(store, word, capsys):
    store.action(word.action.key).unlink()
    status, rows = verify(capsys, "--deep")
    assert (status, [row["found"] for row in rows]) == (0, ["garbage, for gc"])


class Meddles(StoredTask):
    """Alters its input while it reads it."""

    how = luigi.Parameter()

    def requires(self) -> dict[str, StoredTask]:
        return {"word": Word("hello")}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "copy").write_bytes((inputs["word"] / "word.txt").read_bytes())
        inputs["word"].chmod(0o755)
        (inputs["word"] / "word.txt").chmod(0o644)
        {kind.__name__: kind for kind in KINDS}[self.how](inputs["word"])


@every_kind
def test_a_build_that_alters_its_input_fails_and_the_input_is_set_aside(store, word, kind):
    task = Meddles(kind.__name__)
    if kind is stay_writable:
        task.run()
        assert is_right(store, word), "only the modes changed, and were set right"
        return
    with fails("changed", task, "Word hello", KINDS[kind]):
        task.run()
    assert [r.provenance["label"] for r in store.records()].count(task.label) == 0
    assert not Word("hello").complete()
    assert build(Sentence())
    assert is_right(store, word)


@pytest.mark.parametrize("kind", [flip, remove_all], ids=lambda kind: kind.__name__)
def test_repair_keeps_records_while_the_shared_store_does_not_answer(
    store, shared, word, kind, monkeypatch, capsys
):
    damage(store, word, kind)

    def away(*_request: object) -> None:
        raise StoreError("it is away")

    with monkeypatch.context() as outage:
        outage.setattr(Remote, "has", away)
        assert main(["verify", "--deep", "--repair"]) == 2
        assert mentions(capsys.readouterr().err, current_remote().url, "Word hello")
    assert store.record(word.action.key) == word
    open_remote.cache_clear()  # a minute later
    assert main(["verify", "--deep", "--repair"]) == 0
    assert artifact(Word("hello"))
    assert is_right(store, word)
