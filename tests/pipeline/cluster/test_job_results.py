"""What a command makes of the results of its jobs, whatever cluster they ran on."""

import threading
from pathlib import Path

import luigi
import pytest
from build_toys import Act
from expected_failures import fails
from store_toys import NO_WORD, Sentence, Word

from pipeline.cluster.backends import BACKENDS
from pipeline.cluster.job_runner import run_remote_job
from pipeline.cluster.remote_job import JobResult
from pipeline.cluster.submission import build_on_cluster, remote_job_of
from pipeline.errors import LostInputError, TaskFailure
from pipeline.maintenance.attempts import attempts
from pipeline.settings import current_store


def fixed_result(result, act=lambda: None):
    """A backend whose jobs have this result, whatever they did."""

    def run(job):
        act()
        return result

    return run


def built_by(monkeypatch, task, backend):
    monkeypatch.setitem(BACKENDS, "ray", backend)
    return build_on_cluster(task, task.action(), current_store(), task.options)


@pytest.mark.parametrize(
    ("act", "kind", "words"),
    [("refuse", "user", NO_WORD.rstrip(".")), ("crash", "crash", "RuntimeError: a defect")],
)
def test_a_failure_on_a_node_has_the_reason_that_its_job_reports(monkeypatch, act, kind, words):
    task = Act(act, executor="ray")
    with fails(kind, task, words):
        built_by(monkeypatch, task, run_remote_job)


def test_an_artifact_counts_even_if_its_node_was_lost_right_after(monkeypatch):
    task = Act("succeed", executor="ray")
    lost = fixed_result(
        JobResult.from_output("garbage"),
        lambda: Act("succeed").make(task.action(), current_store()),
    )
    assert built_by(monkeypatch, task, lost).action == task.action()


def test_an_input_that_a_node_lost_is_built_again(monkeypatch):
    sentence = Sentence(executor="ray")
    assert luigi.build([Word("hello"), Word("world")], local_scheduler=True)
    with pytest.raises(LostInputError) as lost:
        built_by(
            monkeypatch, sentence, fixed_result(JobResult("lost", Word("world").task_id, "n1"))
        )
    assert lost.value.args == (Word("world"),)


def test_the_command_waits_until_it_sees_the_record(monkeypatch):
    """An NFS client may cache for a minute that the record does not exist."""
    task = Act("succeed", executor="ray")
    later = threading.Timer(1.5, lambda: Act("succeed").make(task.action(), current_store()))
    backend = fixed_result(JobResult("built", "", "n1"), later.start)
    assert built_by(monkeypatch, task, backend).action == task.action()
    later.join()


def test_inputs_are_uploaded_before_the_job_is_submitted(monkeypatch, tmp_path):
    """They were made when there was no shared store, and the node would not find them."""
    assert luigi.build([Word("hello"), Word("world")], local_scheduler=True)
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    seen: list[Path] = []
    backend = fixed_result(
        JobResult("user"), lambda: seen.extend((tmp_path / "shared").rglob("*.tar"))
    )
    with pytest.raises(TaskFailure):
        built_by(monkeypatch, Sentence(executor="ray"), backend)
    assert len(seen) == 2


def test_a_node_that_finds_no_inputs_says_so(monkeypatch):
    sentence = Sentence(executor="ray")
    assert luigi.build([Word("hello"), Word("world")], local_scheduler=True)
    job = remote_job_of(sentence, sentence.action().key, 0, 0)
    monkeypatch.setenv("STYLETRF_STORE", str(current_store().root.with_name("another")))
    assert run_remote_job(job).kind == "lost"


class FullDisks:
    """A backend whose nodes all have full disks, and which runs a job on the first allowed one."""

    def __init__(self, *nodes):
        self._nodes, self.excluded = nodes, []

    def __call__(self, job):
        self.excluded.append(job.excluded_nodes)
        left = [node for node in self._nodes if node not in job.excluded_nodes]
        return JobResult("disk", "full", "host", (left or self._nodes)[0])


def test_a_node_with_a_full_disk_is_excluded_for_a_while(monkeypatch, tmp_path):
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    backend = FullDisks("a", "b")
    task = Act("succeed", executor="ray")
    with fails("disk", task, "full", "host"):
        built_by(monkeypatch, task, backend)
    assert backend.excluded == [(), ("a",), ("a", "b")]
    with pytest.raises(TaskFailure):
        built_by(monkeypatch, Act("warn", executor="ray"), backend)
    assert backend.excluded[3:] == [("a", "b")], "both are known to be full"


def test_a_job_is_submitted_to_three_nodes_at_most(monkeypatch, tmp_path):
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    backend = FullDisks(*"abcdefgh")
    with pytest.raises(TaskFailure):
        built_by(monkeypatch, Act("succeed", executor="ray"), backend)
    assert len(backend.excluded) == 3


def test_a_full_folder_that_all_nodes_share_is_not_tried_again(monkeypatch):
    backend = FullDisks("a", "b")
    with pytest.raises(TaskFailure):
        built_by(monkeypatch, Act("succeed", executor="ray"), backend)
    assert backend.excluded == [()]


def test_a_build_into_another_store_is_reported(monkeypatch):
    monkeypatch.setattr("pipeline.cluster.submission._SECONDS_TO_APPEAR", 0.0)
    task, reasons = Act("succeed", executor="ray"), {}
    for kind in ("built", "lost"):
        backend = fixed_result(JobResult(kind, "", "n1"))
        with fails("user", task, "n1", "STYLETRF_STORE", "STYLETRF_REMOTE") as failure:
            built_by(monkeypatch, task, backend)
        reasons[kind] = failure.value.reason
    assert reasons["built"] != reasons["lost"]
    ends = [attempt.end for attempt in attempts(current_store())]
    assert sorted(ends) == sorted(reasons.values()), "a summary reads them there"
