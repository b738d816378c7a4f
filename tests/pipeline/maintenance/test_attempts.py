"""What keeps a task from being made, as the store tells it."""

import errno
import signal
import time
from collections.abc import Mapping
from pathlib import Path

import luigi
import pytest
from build_toys import Act
from commands import pids_of_slow, start
from message_words import mentions
from store_toys import NO_WORD, Slow, ToyError

from pipeline.execution.executors import EXECUTORS
from pipeline.job import write_outcome
from pipeline.maintenance.attempts import attempts, find_blocking_failure
from pipeline.shared_store.remote import Remote
from pipeline.shared_store.sync import push
from pipeline.task import RunContext, StoredTask

pytestmark = pytest.mark.usefixtures("inline")


class AfterActs(StoredTask):
    """Is built after some acts."""

    acts = luigi.ListParameter()

    def requires(self) -> dict[str, StoredTask]:
        return {act: Act(act) for act in self.acts}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        (out / "note.txt").touch()


class Album(StoredTask):
    """Reads a file outside the store."""

    path = luigi.Parameter(significant=False)
    user_errors = (ToyError,)

    def external_digests(self) -> Mapping[str, str]:
        if not Path(self.path).exists():
            raise ToyError(f"{self.path}: is not there. Put it there.")
        return {"photo": "1"}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        (out / "album.txt").touch()


def build(task: luigi.Task) -> bool:
    return luigi.build([task], local_scheduler=True, logging_conf_file="")


def test_what_was_never_tried_has_nothing_in_its_way(store):
    assert find_blocking_failure(AfterActs(["succeed"]), store) is None


@pytest.mark.parametrize(
    ("act", "reason"),
    [
        ("refuse", NO_WORD),
        ("crash", "RuntimeError: a defect. "),
    ],
)
def test_the_stage_that_failed_says_why(store, act, reason):
    assert not build(AfterActs(["succeed", act]))
    found = find_blocking_failure(AfterActs(["succeed", act]), store)
    assert (found.task, found.is_under_way) == (Act(act), False)
    assert found.reason.startswith(reason)


def test_what_is_made_was_in_nobodys_way(store):
    assert build(AfterActs(["succeed"]))
    assert find_blocking_failure(AfterActs(["succeed"]), store) is None
    assert find_blocking_failure(AfterActs(["succeed", "warn"]), store) is None


def test_what_cannot_be_asked_for_says_why(store, tmp_path):
    path = tmp_path / "photo"
    assert (
        find_blocking_failure(Album(str(path)), store).reason
        == f"{path}: is not there. Put it there."
    )
    path.touch()
    assert find_blocking_failure(Album(str(path)), store) is None


def test_a_failed_rebuild_is_a_failure_unless_the_artifact_is_shared(
    store, toys, tmp_path, monkeypatch
):
    """Its record is there, but nobody has its object."""
    act, remote = Act("refuse_until_mended"), tmp_path / "shared"
    (toys / "mended").touch()
    assert build(act)
    (record,) = store.records()
    remote.mkdir()
    push(store, record, Remote(str(remote)))
    (toys / "mended").unlink()
    store.quarantine(store.object(record.output.digest))
    assert find_blocking_failure(act, store) is None, "it was collected, and no build failed"
    assert not build(act)
    assert find_blocking_failure(act, store).task == act
    monkeypatch.setenv("STYLETRF_REMOTE", str(remote))
    assert find_blocking_failure(act, store) is None


def test_an_attempt_that_runs_is_no_failure_and_a_failure_counts_more(store):
    task = Act("sleep")
    log = store.new_log("Act", task.action().key)
    log.write_text("half of it")
    with store.lock(task.action().key, lambda: None):
        assert find_blocking_failure(AfterActs(["sleep"]), store).is_under_way
        assert not build(Act("refuse"))
        assert find_blocking_failure(AfterActs(["sleep", "refuse"]), store).task == Act("refuse")
    assert find_blocking_failure(AfterActs(["sleep"]), store).reason == "half of it"


def test_a_build_that_could_not_even_write_why_it_failed_has_a_reason_all_the_same(store):
    """On a full disk its log stays empty."""
    log = store.new_log("Act", Act("succeed").action().key)
    log.touch()
    assert mentions(find_blocking_failure(AfterActs(["succeed"]), store).reason, log)
    with store.lock(Act("succeed").action().key, lambda: None):
        assert not find_blocking_failure(AfterActs(["succeed"]), store).reason, "it may still write"


@pytest.mark.parametrize("workers", [[], ["--workers", "2"]])
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_an_attempt_that_was_interrupted_is_no_failure(store, toys, sent, workers):
    """Its empty log was taken for that of a full disk."""
    process = start("luigi", "--module", "toys", "Slow", *workers)
    pids_of_slow(toys)
    process.send_signal(sent)
    process.communicate(timeout=20)
    deadline = time.monotonic() + 10  # processes of a killed command end a moment later
    while any(each.is_under_way for each in attempts(store)) and time.monotonic() < deadline:
        time.sleep(0.02)
    (attempt,) = attempts(store)
    assert (attempt.kind, attempt.is_under_way) == ("interrupted", False)
    assert find_blocking_failure(Slow(), store) is None


def test_an_attempt_that_fails_after_an_interruption_is_a_failure(store, monkeypatch):
    def interrupted(*_words):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setitem(EXECUTORS, "inline", interrupted)
        with pytest.raises(KeyboardInterrupt):
            Act("refuse").run()
    assert find_blocking_failure(Act("refuse"), store) is None
    assert not build(Act("refuse"))
    assert find_blocking_failure(Act("refuse"), store).kind == "user"


def test_an_attempt_that_cannot_write_its_outcome_on_a_full_disk_is_a_failure(store, monkeypatch):
    log = store.new_log("Act", Act("succeed").action().key)
    write_outcome(log, "interrupted", "")

    def full(*_words, **_more):
        raise OSError(errno.ENOSPC, "no space left")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", full)
        write_outcome(log, "disk", "no space left")
    assert mentions(find_blocking_failure(Act("succeed"), store).reason, log)
