import errno
import json
import os
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import ClassVar

import luigi
import pytest
from expected_failures import fails, refuses
from message_words import mentions
from store_toys import Account, Sentence, ToyError, Word, built, mark

from pipeline.code import snapshot
from pipeline.errors import NotBuiltError, TaskFailure
from pipeline.maintenance.verify import problems
from pipeline.settings import current_store
from pipeline.task import RunContext, StoredTask, artifact

pytestmark = pytest.mark.usefixtures("inline")


def build(*tasks: luigi.Task) -> bool:
    return luigi.build(tasks, local_scheduler=True, logging_conf_file="")


def afresh() -> None:
    """As a new process: Luigi knows no instance."""
    luigi.task_register.Register.clear_instance_cache()


class Versioned(StoredTask):
    """Its bytes depend on `content` alone, its key on `edition` too."""

    edition = luigi.IntParameter()
    content = luigi.Parameter(default="same")

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "text").write_text(self.content)


class Reader(StoredTask):
    """Its edition only chooses its input."""

    edition = luigi.IntParameter()
    content = luigi.Parameter(default="same")

    def identity_parameters(self) -> Mapping[str, object]:
        return {}

    def requires(self) -> dict[str, StoredTask]:
        return {"text": Versioned(self.edition, self.content)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "copy").write_text((inputs["text"] / "text").read_text())


class Published(Word):
    """A word that is also put into a folder outside the store."""

    folder = luigi.Parameter(significant=False)

    def published(self) -> bool:
        return (Path(self.folder) / "word.txt").exists()

    def publish(self, object_path: Path) -> None:
        Path(self.folder).mkdir(exist_ok=True)
        (Path(self.folder) / "word.txt").symlink_to(object_path / "word.txt")


class Photographs(StoredTask):
    """Reads a folder outside the store."""

    folder = luigi.Parameter(significant=False)
    user_errors = (ToyError,)
    meddle: ClassVar[bool] = False

    def external_digests(self) -> Mapping[str, str]:
        if not (Path(self.folder) / "photo").exists():
            raise ToyError(f"{self.folder}: no photographs. Put some there.")
        return {"photo": (Path(self.folder) / "photo").read_text()}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        mark(self)
        (out / "photo").write_text((Path(self.folder) / "photo").read_text())
        if type(self).meddle:
            (Path(self.folder) / "photo").write_text("another")


class Adopted(Word):
    """Its code is declared equal to a former one while it is built."""

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        declared = {"family": "Adopted", "from": "former", "to": self.code()}
        text = json.dumps({"families": {}, "code": {}, "adopted": [declared]})
        snapshot.identity_file().write_text(text)
        (out / "word.txt").write_text(self.word)


class Link(StoredTask):
    """A chain of diamonds: 2^depth paths, depth + 1 tasks."""

    depth = luigi.IntParameter()
    visits: ClassVar[int] = 0

    def requires(self) -> dict[str, StoredTask]:
        type(self).visits += 1
        return {side: Link(self.depth - 1) for side in ("left", "right")} if self.depth else {}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        (out / "depth").write_text(str(self.depth))


def test_a_task_is_built_once_and_found_again():
    assert build(Sentence())
    assert built() == ["Sentence", "Word hello", "Word world"]
    assert (artifact(Sentence()) / "sentence.txt").read_text() == "hello world"
    afresh()
    assert Sentence().complete()
    assert build(Sentence())
    assert len(built()) == 3


def test_one_key_for_equal_parameters_and_for_insignificant_ones():
    keys = {Word("a", loudness=x, threads=n).action().key for x in (1, 1.0) for n in (1, 8)}
    assert len(keys) == 1
    assert Word("a", loudness=1.5).action().key not in keys


def test_equal_bytes_upstream_run_nothing_downstream():
    """An upstream rerun that yields the same bytes runs nothing downstream."""
    assert build(Reader(1))
    afresh()
    assert not Reader(2).complete()
    assert build(Reader(2))
    assert built() == ["Reader same", "Versioned same", "Versioned same"]
    assert artifact(Reader(1)) == artifact(Reader(2))


def test_other_bytes_upstream_run_what_is_downstream():
    assert build(Reader(1), Reader(1, "other"))
    assert len(built()) == 4


def test_a_new_word_runs_only_its_own_tasks():
    build(Sentence())
    before = built()
    build(Sentence(("hello", "moon")))
    assert sorted(set(built()) - set(before)) == ["Word moon"]
    assert built().count("Word hello") == 1


def test_unresolved_output_is_absent_and_prints():
    target = Sentence().output()
    assert not target.exists()
    assert mentions(str(target), Sentence())
    with pytest.raises(NotBuiltError):
        _ = target.path
    assert not hasattr(target, "__iter__")
    build(Sentence())
    assert target.exists()
    assert target.path == artifact(Sentence())


def test_an_input_whose_own_inputs_are_missing_is_built_first():
    """With luigid, another machine may have made both, so Luigi starts the last task here."""
    assert [*islice(Account().run(), 1)] == [Sentence()]


def test_a_user_error_of_the_inputs_surfaces_when_the_task_runs(tmp_path):
    task = Photographs(str(tmp_path / "nowhere"))
    assert not task.complete()
    assert not task.output().exists()
    with fails("user", task, tmp_path / "nowhere"):
        task.run()


def test_outside_files_count_by_digest_not_by_place(tmp_path):
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "photo").write_text("sky")
    assert build(Photographs(str(tmp_path / "here")))
    afresh()
    assert Photographs(str(tmp_path / "there")).complete()
    (tmp_path / "there" / "photo").write_text("sea")
    afresh()
    assert not Photographs(str(tmp_path / "there")).complete()


def test_files_edited_during_the_build_publish_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(Photographs, "meddle", True)
    (tmp_path / "photo").write_text("sky")
    task = Photographs(str(tmp_path))
    with fails("changed", task):
        task.run()
    assert not list((current_store().root / "actions").glob("*/*"))


def test_a_build_whose_code_is_adopted_while_it_runs_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(snapshot, "identity_file", lambda: tmp_path / "identity.json")
    task = Adopted("a")
    task.run()
    assert current_store().record(task.action().key)


def test_what_is_outside_the_store_is_restored_without_a_build(tmp_path):
    task = Published("a", folder=str(tmp_path / "out"))
    assert build(task)
    link = tmp_path / "out" / "word.txt"
    link.unlink()
    afresh()
    assert not task.complete()
    assert build(task)
    assert link.read_text() == "a"
    assert len(built()) == 1


def test_an_object_lost_upstream_does_not_undo_what_is_downstream():
    build(Sentence())
    store = current_store()
    store.quarantine(artifact(Word("hello")))
    afresh()
    assert not Word("hello").complete()
    assert Sentence().complete()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_damaged_input_is_set_aside_and_made_again(workers):
    build(Word("hello"), Word("world"))
    file = artifact(Word("hello")) / "word.txt"
    file.chmod(0o644)
    file.write_text("hallo")
    afresh()
    assert luigi.build([Sentence()], local_scheduler=True, logging_conf_file="", workers=workers), (
        "in the same command"
    )
    assert built() == ["Sentence", "Word hello", "Word hello", "Word world"]
    assert not list(problems(current_store(), deep=True))


def test_a_task_without_a_usable_store_is_incomplete_and_its_run_is_refused(monkeypatch):
    store = current_store()
    (store.root / "format").write_text("styletrf store 99\n")
    import pipeline.settings

    monkeypatch.setattr(pipeline.settings, "open_store", type(store).open)
    assert Word("a").complete() is False
    with refuses(store.root, "styletrf store 99"):
        Word("a").run()


def test_a_build_that_makes_nothing_fails():
    class Nothing(StoredTask):
        def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
            pass

    with pytest.raises(TaskFailure) as failure:
        Nothing().run()
    assert failure.value.kind == "crash"


def test_diamonds_are_resolved_in_linear_time():
    Link.visits = 0
    assert not Link(60).complete()
    assert Link.visits == 61
    assert build(Link(60))
    assert Link.visits < 61**2
    afresh()
    Link.visits = 0
    assert Link(60).complete()
    assert Link.visits == 61


def test_provenance_names_the_task_its_log_and_its_memory():
    build(Word("a"))
    path = current_store().action(Word("a").action().key)
    provenance = json.loads(path.read_text())["provenance"]
    assert provenance["label"] == "Word a"
    assert provenance["task"] == str(Word("a"))
    assert (current_store().root / provenance["log"]).exists()
    assert provenance["peak_memory_bytes"] > 1e6


def test_pinned_revision_replaces_the_code():
    class Pinned(Word):
        revision = "1"

    assert Pinned("a").action().code == "revision 1"


def test_tools_are_keyed_by_public_version(monkeypatch):
    import pipeline.record

    monkeypatch.setattr(pipeline.record, "version", lambda name: "2.13.0+cpu")
    pipeline.record.public_version.cache_clear()
    monkeypatch.setattr(Word, "tools", ("torch",))
    assert Word("a").action().tools == {"torch": "2.13.0"}
    pipeline.record.public_version.cache_clear()


def test_a_full_disk_is_reported_as_such(monkeypatch):
    def full(*_args):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with fails("disk", Word("a"), os.strerror(errno.ENOSPC), "STYLETRF_STORE"):
        Word("a").run()
    monkeypatch.undo()


def test_a_disk_on_which_no_file_can_be_made_is_a_full_disk(monkeypatch):
    """It may have bytes left and no inodes: then the failure has no log either."""
    current_store()

    def full(*_words: object, **_options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as disk:
        disk.setattr(os, "mkdir", full)
        disk.setattr(Path, "touch", full)
        with fails("disk", Word("a"), os.strerror(errno.ENOSPC), "STYLETRF_STORE"):
            Word("a").run()
    assert built() == []
