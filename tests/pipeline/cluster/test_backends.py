"""Builds on a cluster: what holds for every backend, on real clusters."""

import contextlib
import importlib.util
import json
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import luigi
import pytest
from build_toys import Act
from commands import are_gone, pids_of_slow, start
from expected_failures import fails, refuses
from forked_modules import ForkedModule
from message_words import mentions
from ray_process import RayCluster
from slurm_cluster import SlurmCluster, is_installed
from store_toys import NO_WORD, Sentence, Word, built

from pipeline.cluster import backends
from pipeline.cluster.backends import BACKENDS
from pipeline.cluster.job_runner import run_remote_job
from pipeline.cluster.ray_driver import resource_request
from pipeline.cluster.remote_job import JobResult, RemoteJob
from pipeline.cluster.submission import build_on_cluster, remote_job_of
from pipeline.errors import LostInputError, TaskFailure
from pipeline.maintenance.attempts import attempts
from pipeline.maintenance.verify import problems
from pipeline.settings import current_store

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cluster() -> Iterator[RayCluster]:
    if importlib.util.find_spec("ray") is None:
        pytest.skip("needs the extra `ray`")
    cluster = RayCluster()
    yield cluster
    cluster.end()


@pytest.fixture(scope="module")
def slurm(tmp_path_factory) -> Iterator[SlurmCluster]:
    if not is_installed():
        pytest.skip("needs SLURM and munge (Debian: slurm-wlm, munge), and root")
    cluster = SlurmCluster(tmp_path_factory.mktemp("slurm"))
    yield cluster
    cluster.end()


@pytest.fixture(params=["ray", "slurm"])
def machines(request) -> RayCluster | SlurmCluster:
    """The nodes of a cluster, which a test adds and removes."""
    return request.getfixturevalue({"ray": "cluster"}.get(request.param, request.param))


@pytest.fixture
def backend(machines, tmp_path, monkeypatch) -> str:
    """A backend, with its settings here and in the commands that a test starts."""
    settings = "[host]\ncores = 1\n"
    if isinstance(machines, RayCluster):
        settings += f"[ray]\naddress = {machines.address}\n"
    else:
        monkeypatch.setenv("SLURM_CONF", str(machines.settings))
    (tmp_path / "backend.cfg").write_text(settings)
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(tmp_path / "backend.cfg"))
    monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / "store"))
    return "ray" if isinstance(machines, RayCluster) else "slurm"


def finish(process: ForkedModule) -> tuple[int, str]:
    screen = "".join(process.communicate(timeout=120))
    return process.returncode, screen


def submit(backend: str, *words: str) -> ForkedModule:
    return start("luigi", "--module", "toys", *words, f"--{words[0]}-executor", backend)


def test_a_build_on_a_node_is_found_by_the_command(backend):
    status, screen = finish(submit(backend, "Act", "--act", "succeed"))
    assert status == 0, screen
    (record,) = current_store().records()
    first, *_, last = (line for line in screen.splitlines() if line.startswith("Act succeed: "))
    assert mentions(first, backend)
    assert mentions(last, "done", record.provenance["host"])
    assert built() == ["Act succeed"]
    assert not list(problems(current_store(), deep=True))
    status, screen = finish(submit(backend, "Act", "--act", "succeed"))
    assert status == 0, screen
    assert "Act succeed: " not in screen
    assert built() == ["Act succeed"]


def test_the_command_reports_the_reason_of_a_failure_on_a_node(backend):
    status, screen = finish(submit(backend, "Act", "--act", "be_killed"))
    assert status == 30
    assert mentions(screen, Act("be_killed"), "SIGKILL")
    assert "Traceback" not in screen


def test_a_node_refuses_a_job_whose_key_it_does_not_compute(backend):
    result = BACKENDS[backend](remote_job_of(Act("succeed"), "0" * 64, 0, 0))
    assert result.kind == "user"
    assert mentions(result.message, result.host, Act("succeed").action().key[:16], "0" * 16)
    assert built() == []


def test_a_killed_command_ends_its_build(backend, toys):
    process = submit(backend, "Slow")
    pids = pids_of_slow(toys)
    process.kill()
    process.communicate()
    if backend == "slurm":  # where a job outlives its command
        subprocess.run(["scancel", "--user", "root"], check=True)
    assert are_gone(pids)


def test_the_job_of_a_lost_node_goes_on_from_its_checkpoint(backend, machines, toys):
    """Its power goes while it builds, and another node runs the job."""
    process = submit(backend, "Slow")
    pids = pids_of_slow(toys)
    machines.do(f"kill {machines.node_of(pids[0])}")
    assert are_gone(pids)
    machines.do("add")
    status, screen = finish(process)
    assert status == 0, screen
    (record,) = current_store().records()
    artifact = current_store().object(record.output.digest)
    assert (artifact / "result.txt").read_text() == "resumed"
    assert not list(problems(current_store(), deep=True))
    assert built() == ["Slow sleep"] * 2, "started, and continued"


@contextlib.contextmanager
def small_disk_first(backend, machines, tmp_path, mebibytes) -> Iterator[None]:
    """A node to which jobs go first, and whose store is on a disk of its own.

    Ray chooses it as the only one with enough cores, SLURM by its weight.
    """
    if backend == "ray":
        settings = (tmp_path / "backend.cfg").read_text()
        (tmp_path / "backend.cfg").write_text(settings.replace("cores = 1", "cores = 8"))
    (tmp_path / "store").mkdir()
    machines.do(f"apart {tmp_path / 'store'} {mebibytes} 8")
    try:
        yield
    finally:
        machines.do("kill -1")


def test_the_job_of_a_node_with_a_full_disk_goes_to_another_node(
    backend, machines, tmp_path, monkeypatch
):
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    (tmp_path / "shared").mkdir()
    with small_disk_first(backend, machines, tmp_path, 1):
        status, screen = finish(submit(backend, "Large", "--name", "a"))
    assert status == 0, screen
    (moved,) = (line for line in screen.splitlines() if mentions(line, "STYLETRF_STORE"))
    assert moved.startswith("Large on ")
    assert built() == ["Large a"] * 2


def test_a_build_waits_for_a_shared_store_that_fails_for_a_while(
    backend, machines, proxied, tmp_path, monkeypatch
):
    """The node cannot upload its artifact, and the command cannot find it."""
    place, proxy = proxied
    options = {"client_kwargs": {"endpoint_url": f"http://127.0.0.1:{proxy.port}"}}
    options |= {"key": "a", "secret": "b"}
    with (tmp_path / "backend.cfg").open("a") as settings:
        settings.write(f"[store]\nremote = {place.url}\nremote_options = {json.dumps(options)}\n")
    monkeypatch.delenv("STYLETRF_REMOTE")
    with small_disk_first(backend, machines, tmp_path, 64):
        process = submit(backend, "Large", "--name", "a")
        while not built():
            time.sleep(0.02)
        end = time.monotonic() + 4
        proxy.fault = lambda _method, _path: 500 if time.monotonic() < end else None
        status, screen = finish(process)
    assert status == 0, screen
    assert time.monotonic() > end
    assert built() == ["Large a"], screen
    assert len(place.names("actions")) == 1


def test_a_missing_cluster_is_reported_in_one_line(tmp_path, monkeypatch):
    (tmp_path / "backend.cfg").write_text("[ray]\naddress = 127.0.0.1:9\n")
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(tmp_path / "backend.cfg"))
    monkeypatch.setenv("PATH", str(tmp_path))
    for name, words in (("slurm", ["sbatch", "--executor"]), ("ray", ["Ray"])):
        status, screen = finish(submit(name, "Act", "--act", "succeed"))
        assert status == 30
        assert mentions(screen, *words)
        assert "Traceback" not in screen


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


@pytest.mark.parametrize("machines", ["slurm"], indirect=True)
def test_a_held_job_is_a_failure_and_is_canceled(backend, tmp_path):
    with (tmp_path / "backend.cfg").open("a") as settings:
        settings.write("[slurm]\noptions = --hold\n")
    status, screen = finish(submit(backend, "Act", "--act", "succeed"))
    assert status == 30
    assert mentions(screen, "SLURM", "JobHeldUser")
    assert not subprocess.run(["squeue", "-h"], capture_output=True, check=True).stdout


@pytest.mark.parametrize("machines", ["slurm"], indirect=True)
def test_a_job_has_its_environment_whatever_sbatch_exports(backend, tmp_path):
    with (tmp_path / "backend.cfg").open("a") as settings:
        settings.write("[slurm]\noptions = --export=NONE\n")
    status, screen = finish(submit(backend, "Act", "--act", "succeed"))
    assert status == 0, screen
    assert built() == ["Act succeed"]


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


def test_a_job_requests_what_one_node_has():
    """The GPUs of one node and the cores of another do not add up."""
    job = replace(remote_job_of(Act("succeed"), "0" * 64, 8 << 30, 0), cores=8, gpus=2)
    nodes = {
        "small": {"CPU": 4.0, "GPU": 1.0, "memory": 4.0 * 2**30},
        "large": {"CPU": 64.0, "memory": 256.0 * 2**30},
    }
    request = resource_request(job, nodes)
    assert request.pop("label_selector") == {}
    assert request == {"num_cpus": 4, "num_gpus": 1, "memory": 4 << 30}
    assert resource_request(replace(job, gpus=0), nodes)["num_cpus"] == 8
    away = resource_request(replace(job, excluded_nodes=("small",)), nodes)
    assert (away["num_cpus"], away["num_gpus"]) == (8, 0)
    assert away["label_selector"] == {"ray.io/node-id": "!in(small)"}
    nowhere = resource_request(replace(job, excluded_nodes=("small", "large")), nodes)
    assert nowhere["label_selector"] == {}, "one of them runs the job"
    for growing in ({}, {"head": {"CPU": 0.0, "memory": 2.0**30}}):
        request = resource_request(job, growing)
        assert (request["num_cpus"], request["num_gpus"], request["memory"]) == (8, 2, 8 << 30)


def test_a_job_survives_json():
    job = remote_job_of(Act("succeed"), "0" * 64, 5 << 30, 0)
    assert RemoteJob.from_json(job.to_json()) == job
    assert job.parameters["executor"] == "subprocess", "the node does not submit it again"


@pytest.mark.parametrize("output", ["", "a line\n", '{"kind": "bui', "Killed\n[]\n"])
def test_output_without_a_result_means_a_lost_machine(output):
    assert JobResult.from_output(output).kind == "killed"


def test_the_last_result_in_the_output_counts():
    result = JobResult("built", host="n1")
    assert (
        JobResult.from_output(f"noise\n{JobResult('crash').to_json()}\n{result.to_json()}\n\n")
        == result
    )


@pytest.fixture
def options_of_slurm() -> Iterator[Callable[[str], list[str]]]:
    """Returns the options of `sbatch` for a job with `[slurm] options`."""
    config, job = luigi.configuration.get_config(), remote_job_of(Act("succeed"), "0" * 64, 0, 0)

    def options(text: str) -> list[str]:
        config.set("slurm", "options", text)
        return backends._sbatch_options(replace(job, gpus=0))

    yield options
    config.remove_section("slurm")


def test_quotes_in_options_of_slurm_are_those_of_a_shell(options_of_slurm):
    found = options_of_slurm("""--constraint="a100|h100" --comment='my grid' -p gpu""")
    assert found[-4:] == ["--constraint=a100|h100", "--comment=my grid", "-p", "gpu"]
    with refuses("[slurm] options", "luigi.cfg"):
        options_of_slurm("--comment='my grid")
