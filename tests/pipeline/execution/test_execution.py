"""A task's build from first to last: its failures are reported, tried again and cleaned up."""

import errno
import json
import os
import re
from pathlib import Path

import luigi
import psutil
import pytest
from build_toys import UNREACHABLE, Act
from commands import are_gone, pids_of_slow
from expected_failures import log_named_in
from message_words import mentions
from small_disk import small_disk
from store_toys import NO_WORD, Fills, Slow, Surroundings, Word, built

from pipeline.errors import StoreError, TaskFailure, describe_error, is_disk_full
from pipeline.execution.environment import SPIN_COUNT, build_settings
from pipeline.settings import current_store
from pipeline.task import artifact

pytestmark = pytest.mark.usefixtures("forked_builds")


def failure_of(task: luigi.Task) -> TaskFailure:
    with pytest.raises(TaskFailure) as failure:
        task.run()
    assert not list(current_store().records())
    assert not list((current_store().root / "tmp").iterdir())
    assert failure.value.task == str(task)
    return failure.value


@pytest.fixture
def impatient():
    """Second attempts follow at once."""
    luigi.configuration.get_config().set("store", "retry_seconds", "0.1")
    yield
    luigi.configuration.get_config().remove_option("store", "retry_seconds")


def test_a_build_has_the_settings_for_threads_that_wait_and_for_freed_memory(monkeypatch):
    for name in (*build_settings({}), "OMP_WAIT_POLICY", "GLIBC_TUNABLES"):
        monkeypatch.delenv(name, raising=False)
    Surroundings().run()
    variables = json.loads((artifact(Surroundings()) / "environment.json").read_text())
    assert build_settings({}).items() <= variables.items()
    assert int(variables[SPIN_COUNT]) < 100_000, "a count of seconds would be some 1e9"


def test_a_killed_build_goes_on_from_its_checkpoint(toys):
    failure = failure_of(Slow("suicide"))
    assert failure.kind == "killed"
    assert mentions(failure.reason, "SIGKILL")
    assert re.search(r"\b\d+ s, 0\.\d GiB\b", failure.reason)
    assert are_gone(pids_of_slow(toys))
    log = log_named_in(failure.reason).read_text()
    assert "printed by python\nprinted by a library\n" in log
    Slow("suicide").run()
    assert (artifact(Slow("suicide")) / "result.txt").read_text() == "resumed"
    assert not list((current_store().root / "resume").iterdir())


def test_a_build_beyond_its_time_fails_and_names_the_limit_and_the_log():
    failure = failure_of(Act("sleep", timeout_seconds=1))
    assert failure.kind == "timeout"
    assert re.search(r"\b[1-9]\d* s, 0\.", failure.reason)
    assert mentions(failure.reason, "--Act-timeout-seconds", log_named_in(failure.reason))


def test_a_build_beyond_its_memory_fails_and_names_the_limit_and_the_log():
    failure = failure_of(Act("let_a_child_eat", memory_gib=0.15))
    assert failure.kind == "memory"
    assert re.search(r"\b\d+ s, 0\.2 GiB\b", failure.reason)
    assert mentions(failure.reason, "--Act-memory-gib", log_named_in(failure.reason))


def test_limits_are_no_part_of_the_key():
    keys = {Act("succeed", timeout_seconds=t, memory_gib=t).action().key for t in (0, 1.5)}
    assert len(keys) == 1


def test_a_crash_leaves_its_trace_in_the_log():
    failure = failure_of(Word("crash"))
    assert failure.kind == "crash"
    assert "RuntimeError: a defect" in failure.reason
    assert "Traceback" in log_named_in(failure.reason).read_text()


def test_a_build_that_leaves_early_is_no_success():
    failure = failure_of(Act("leave"))
    assert failure.kind == "crash"
    assert mentions(failure.reason, "status 0", log_named_in(failure.reason))


def test_a_user_error_keeps_its_words():
    failure = failure_of(Word("bad"))
    assert failure.kind == "user"
    assert failure.reason == NO_WORD


def test_a_full_disk_in_the_build_is_reported_as_such():
    failure = failure_of(Fills())
    assert failure.kind == "disk"
    assert mentions(failure.reason, os.strerror(errno.ENOSPC), "STYLETRF_STORE")


@pytest.mark.parametrize("act", ["save_tensors", "copy"])
def test_a_full_disk_is_reported_as_such_whatever_a_library_says(act, tmp_path, monkeypatch):
    """One has an error of its own for it; one says no more than that it failed."""
    monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / "full" / "store"))
    with small_disk(tmp_path / "full", mebibytes=3):
        failure = failure_of(Act(act))
    assert failure.kind == "disk"
    cause = {"save_tensors": "SafetensorError", "copy": "CalledProcessError"}[act]
    assert mentions(failure.reason, cause, "STYLETRF_STORE")
    assert str(tmp_path / "full") in failure.reason


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_recognized_by_the_words_of_the_system(number, tmp_path):
    error = RuntimeError(f"cannot write: {os.strerror(number)} (os error {number})")
    assert describe_error(error, tmp_path / "log")[0] == "disk"
    assert describe_error(RuntimeError("cannot write"), tmp_path / "log")[0] == "crash"
    theirs = StoreError(f"the shared store s3://b: {os.strerror(number)}")
    assert describe_error(theirs, tmp_path / "log")[0] == "user"
    assert not is_disk_full(theirs)


@pytest.mark.usefixtures("impatient")
def test_what_may_pass_is_tried_again(caplog):
    caplog.set_level("INFO", logger="pipeline")
    Act("lose_once").run()
    assert built() == ["Act lose_once"] * 2
    (message,) = (line for line in caplog.messages if UNREACHABLE in line)
    assert message.startswith(f"{Act('lose_once')}: {UNREACHABLE}. ")
    assert mentions(message, "0 s")
    logs = current_store().root / "logs" / "Act"
    assert len(list(logs.glob("*.log"))) == 2


@pytest.mark.usefixtures("impatient")
def test_what_does_not_pass_fails_at_the_third_attempt():
    assert failure_of(Act("lose")).kind == "transient"
    assert len(built()) == 3


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("act", ["refuse", "crash", "be_killed", "leave"])
def test_what_does_not_pass_by_itself_is_not_tried_again(act):
    failure_of(Act(act))
    assert len(built()) == 1


@pytest.mark.parametrize("act", ["refuse", "crash", "be_killed"])
def test_a_failure_without_a_checkpoint_leaves_no_folder_for_one(act):
    failure_of(Act(act))
    assert not list((current_store().root / "resume").iterdir())


def test_a_finished_build_leaves_no_process_and_no_open_file():
    assert not Word("a").complete()  # which opens what stays open: the lease of this process
    before, descriptors = (
        len(psutil.Process().children()),
        len(list(Path("/proc/self/fd").iterdir())),
    )
    Word("a").run()
    assert len(psutil.Process().children()) == before
    assert len(list(Path("/proc/self/fd").iterdir())) == descriptors
