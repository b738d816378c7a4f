"""Builds on a cluster: what holds for every backend, on real clusters."""

import contextlib
import importlib.util
import json
import subprocess
import time
from collections.abc import Iterator

import pytest
from build_toys import Act
from commands import are_gone, pids_of_slow, start
from forked_modules import ForkedModule
from message_words import mentions
from ray_process import RayCluster
from slurm_cluster import SlurmCluster, is_installed
from store_toys import built

from pipeline.cluster.backends import BACKENDS
from pipeline.cluster.submission import remote_job_of
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
