from pathlib import Path

import psutil
import pytest
from store_toys import Fills, Slow, Word
from test_command import are_gone, pids_of_slow

from pipeline.errors import TaskFailure
from pipeline.settings import current_store
from pipeline.task import artifact


def log_of(failure: TaskFailure) -> str:
    return Path(failure.reason.split("Its log: ")[1]).read_text()


def test_a_fresh_interpreter_builds():
    Word("a").run()
    assert (artifact(Word("a")) / "word.txt").read_text() == "a"
    record = Word("a").record()
    assert 0 < record.provenance["seconds"] < 30
    assert 5e6 < record.provenance["peak_memory_bytes"] < 1e9


def test_a_build_ended_by_a_signal_is_told_apart(toys):
    with pytest.raises(TaskFailure, match="ended by SIGKILL") as failure:
        Slow("suicide").run()
    assert failure.value.kind == "killed"
    assert are_gone(pids_of_slow(toys))
    assert "printed by python\nprinted by a library\n" in log_of(failure.value)
    Slow("suicide").run()
    assert (artifact(Slow("suicide")) / "result.txt").read_text() == "resumed"


def test_a_build_out_of_time_is_ended_with_all_it_started(toys, monkeypatch):
    monkeypatch.setattr(Slow, "timeout_seconds", 2.0)
    with pytest.raises(TaskFailure, match="took too long") as failure:
        Slow().run()
    assert failure.value.kind == "timeout"
    assert are_gone(pids_of_slow(toys))


def test_a_crash_leaves_its_trace_in_the_log():
    with pytest.raises(TaskFailure, match="RuntimeError: a defect") as failure:
        Word("crash").run()
    assert failure.value.kind == "crash"
    log = Path(failure.value.reason.split("The trace is in ")[1])
    assert "Traceback" in log.read_text()


def test_a_user_error_keeps_its_words():
    with pytest.raises(TaskFailure) as failure:
        Word("bad").run()
    assert failure.value.kind == "user"
    assert failure.value.reason == "words/bad: is no word. Choose another one."


def test_a_full_disk_in_the_build_is_told_as_such():
    with pytest.raises(TaskFailure, match="no space left") as failure:
        Fills().run()
    assert failure.value.kind == "user"
    assert not list((current_store().root / "tmp").iterdir())


def test_nothing_stays_behind():
    before, descriptors = (
        len(psutil.Process().children()),
        len(list(Path("/proc/self/fd").iterdir())),
    )
    Word("a").run()
    assert len(psutil.Process().children()) == before
    assert len(list(Path("/proc/self/fd").iterdir())) == descriptors
