"""Builds on other machines: what every engine keeps to, over real ones."""

import contextlib
import importlib.util
import json
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import luigi
import pytest
from build_toys import Act
from ray_process import RayCluster
from slurm_cluster import SlurmCluster, is_installed
from store_toys import Sentence, Word, built
from test_command import are_gone, pids_of_slow, start

from pipeline.attempts import attempts
from pipeline.building import build
from pipeline.engines import ENGINES
from pipeline.errand import Errand, Outcome, outcome_in, perform
from pipeline.errors import LostInputError, TaskFailure
from pipeline.placing import place
from pipeline.ray_engine import needs
from pipeline.settings import current_store
from pipeline.verify import problems, records

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
    """Those of an engine, of which a test takes some away and adds others."""
    return request.getfixturevalue({"ray": "cluster"}.get(request.param, request.param))


@pytest.fixture
def engine(machines, tmp_path, monkeypatch) -> str:
    """An engine at hand, with settings for it here and in the commands started."""
    settings = "[host]\ncores = 1\n"
    if isinstance(machines, RayCluster):
        settings += f"[ray]\naddress = {machines.address}\n"
    else:
        monkeypatch.setenv("SLURM_CONF", str(machines.settings))
    (tmp_path / "engine.cfg").write_text(settings)
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(tmp_path / "engine.cfg"))
    monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / "store"))
    return "ray" if isinstance(machines, RayCluster) else "slurm"


def finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    screen = "".join(process.communicate(timeout=120))
    return process.returncode, screen


def send(engine: str, *words: str) -> subprocess.Popen[str]:
    return start("luigi", "--module", "build_toys", *words, f"--{words[0]}-executor", engine)


def test_it_is_built_there_and_found_here(engine):
    status, screen = finish(send(engine, "Act", "--act", "succeed"))
    assert status == 0, screen
    assert f"Act succeed: sent out by {engine}" in screen
    assert "Act succeed: done on" in screen
    assert built() == ["Act succeed"]
    assert not list(problems(current_store(), deep=True))
    status, screen = finish(send(engine, "Act", "--act", "succeed"))
    assert "Did not run any tasks" in screen


@pytest.mark.parametrize(
    ("act", "words"),
    [
        ("refuse", "words/bad: is no word. Choose another one"),
        ("crash", "RuntimeError: a defect. The trace is in"),
        ("be_killed", "ended by SIGKILL"),
    ],
)
def test_a_failure_there_is_told_in_its_words_here(engine, act, words):
    status, screen = finish(send(engine, "Act", "--act", act))
    assert status == 30
    assert words in screen
    assert "Traceback" not in screen


def test_a_machine_that_would_build_something_else_refuses(engine):
    errand = Errand.of(Act("succeed"), "0" * 64, 0)
    outcome = ENGINES[engine].run(errand)
    assert outcome.kind == "user"
    assert "has other code, inputs or files than the machine that asks" in outcome.message
    assert built() == []


def test_a_command_that_is_killed_takes_its_build_with_it(engine, toys):
    process = send(engine, "Slow")
    pids = pids_of_slow(toys)
    process.kill()
    process.communicate()
    if engine == "slurm":  # where the job is a matter of its own
        subprocess.run(["scancel", "--user", "root"], check=True)
    assert are_gone(pids)


def test_a_lost_node_costs_a_step_and_nothing_else(engine, machines, toys):
    """Its power goes while it builds; the errand is sent again, and goes on from the checkpoint."""
    process = send(engine, "Slow")
    pids = pids_of_slow(toys)
    machines.do(f"kill {machines.node_of(pids[0])}")
    assert are_gone(pids)
    machines.do("add")
    status, screen = finish(process)
    assert status == 0, screen
    (record,) = records(current_store())
    artifact = current_store().object(record.output.digest)
    assert (artifact / "result.txt").read_text() == "resumed"
    assert not list(problems(current_store(), deep=True))
    assert built() == ["Slow sleep"] * 2, "begun, and gone on with"


@contextlib.contextmanager
def own_disk_first(engine, machines, tmp_path, mebibytes) -> Iterator[None]:
    """A node to which errands go first, and whose store is on a disk of its own.

    Ray has it as the only one with the cores that are asked for, SLURM by its weight.
    """
    if engine == "ray":
        settings = (tmp_path / "engine.cfg").read_text()
        (tmp_path / "engine.cfg").write_text(settings.replace("cores = 1", "cores = 8"))
    (tmp_path / "store").mkdir()
    machines.do(f"apart {tmp_path / 'store'} {mebibytes} 8")
    try:
        yield
    finally:
        machines.do("kill -1")


def test_a_full_disk_of_one_node_is_the_work_of_another(engine, machines, tmp_path, monkeypatch):
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    (tmp_path / "shared").mkdir()
    with own_disk_first(engine, machines, tmp_path, 1):
        status, screen = finish(send(engine, "Large", "--name", "a"))
    assert status == 0, screen
    assert "sent on. no space left on the disk" in screen
    assert built() == ["Large a"] * 2


def test_a_shared_store_that_errs_for_a_while_is_waited_for(
    engine, machines, proxied, tmp_path, monkeypatch
):
    """By the node, which has built what it cannot give, and by who asks, who cannot see it."""
    place, proxy = proxied
    options = {"client_kwargs": {"endpoint_url": f"http://127.0.0.1:{proxy.port}"}}
    options |= {"key": "a", "secret": "b"}
    with (tmp_path / "engine.cfg").open("a") as settings:
        settings.write(f"[store]\nremote = {place.url}\nremote_options = {json.dumps(options)}\n")
    monkeypatch.delenv("STYLETRF_REMOTE")
    with own_disk_first(engine, machines, tmp_path, 64):
        process = send(engine, "Large", "--name", "a")
        while not built():
            time.sleep(0.02)
        end = time.monotonic() + 12
        proxy.fault = lambda _method, _path: 500 if time.monotonic() < end else None
        status, screen = finish(process)
    assert status == 0, screen
    assert time.monotonic() > end
    assert built() == ["Large a"], screen
    assert len(place.names("actions")) == 1


def test_an_engine_that_is_not_there_is_told_in_a_line(tmp_path, monkeypatch):
    (tmp_path / "engine.cfg").write_text("[ray]\naddress = 127.0.0.1:9\n")
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(tmp_path / "engine.cfg"))
    monkeypatch.setenv("PATH", str(tmp_path))
    for name, words in (("slurm", "sbatch is not installed"), ("ray", "Ray cannot be used")):
        status, screen = finish(send(name, "Act", "--act", "succeed"))
        assert status == 30
        assert words in screen
        assert "Traceback" not in screen


class Answers:
    """An engine whose machines answer so, whatever they did."""

    def __init__(self, outcome, act=lambda: None):
        self._outcome, self._act = outcome, act

    def run(self, errand):
        self._act()
        return self._outcome


def placed(monkeypatch, task, engine):
    monkeypatch.setitem(ENGINES, "ray", engine)
    return place(task, task.action(), current_store())


def test_what_was_built_counts_even_if_its_machine_was_lost_right_after(monkeypatch):
    task = Act("succeed", executor="ray")
    lost = Answers(
        outcome_in("garbage"), lambda: build(Act("succeed"), task.action(), current_store())
    )
    assert placed(monkeypatch, task, lost).action == task.action()


def test_an_input_that_is_lost_there_is_made_again(monkeypatch):
    sentence = Sentence(executor="ray")
    assert luigi.build([Word("hello"), Word("world")], local_scheduler=True)
    with pytest.raises(LostInputError) as lost:
        placed(monkeypatch, sentence, Answers(Outcome("lost", Word("world").task_id, "n1")))
    assert lost.value.args == (Word("world"),)


def test_what_was_built_is_waited_for_until_it_can_be_seen(monkeypatch):
    """A folder of NFS looks for a minute as it did when it was last asked."""
    task = Act("succeed", executor="ray")
    later = threading.Timer(1.5, lambda: build(Act("succeed"), task.action(), current_store()))
    engine = Answers(Outcome("built", "", "n1"), later.start)
    assert placed(monkeypatch, task, engine).action == task.action()
    later.join()


def test_inputs_that_were_never_given_are_given_before(monkeypatch, tmp_path):
    """They were made when there was no shared store: the other machine would find none."""
    assert luigi.build([Word("hello"), Word("world")], local_scheduler=True)
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    seen: list[Path] = []
    engine = Answers(Outcome("user"), lambda: seen.extend((tmp_path / "shared").rglob("*.tar")))
    with pytest.raises(TaskFailure):
        placed(monkeypatch, Sentence(executor="ray"), engine)
    assert len(seen) == 2


def test_a_machine_that_finds_no_inputs_is_told_to_share_a_store(monkeypatch):
    sentence = Sentence(executor="ray")
    assert luigi.build([Word("hello"), Word("world")], local_scheduler=True)
    errand = Errand.of(sentence, sentence.action().key, 0)
    monkeypatch.setenv("STYLETRF_STORE", str(current_store().root.with_name("another")))
    outcome = perform(errand)
    assert outcome.kind == "lost"


class FullDisks:
    """An engine whose machines are full, as long as there is one that was not asked."""

    def __init__(self, *nodes):
        self._nodes, self.asked = nodes, []

    def run(self, errand):
        self.asked.append(errand.rather_not)
        left = [node for node in self._nodes if node not in errand.rather_not]
        return Outcome("disk", "full", "host", (left or self._nodes)[0])


def test_a_full_machine_is_left_out_for_a_while(monkeypatch, tmp_path):
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    engine = FullDisks("a", "b")
    with pytest.raises(TaskFailure, match="full"):
        placed(monkeypatch, Act("succeed", executor="ray"), engine)
    assert engine.asked == [(), ("a",), ("a", "b")]
    with pytest.raises(TaskFailure):
        placed(monkeypatch, Act("warn", executor="ray"), engine)
    assert engine.asked[3:] == [("a", "b")], "it is known by now"


def test_not_all_machines_are_filled_by_one_errand(monkeypatch, tmp_path):
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    engine = FullDisks(*"abcdefgh")
    with pytest.raises(TaskFailure):
        placed(monkeypatch, Act("succeed", executor="ray"), engine)
    assert len(engine.asked) == 3


def test_a_full_folder_that_all_share_is_full_for_all(monkeypatch):
    engine = FullDisks("a", "b")
    with pytest.raises(TaskFailure):
        placed(monkeypatch, Act("succeed", executor="ray"), engine)
    assert engine.asked == [()]


@pytest.mark.parametrize("machines", ["slurm"], indirect=True)
def test_a_job_that_is_held_is_a_failure_and_does_not_stay(engine, tmp_path):
    with (tmp_path / "engine.cfg").open("a") as settings:
        settings.write("[slurm]\noptions = --hold\n")
    status, screen = finish(send(engine, "Act", "--act", "succeed"))
    assert status == 30
    assert "SLURM does not let its job" in screen
    assert "PENDING JobHeldUser" in screen
    assert not subprocess.run(["squeue", "-h"], capture_output=True, check=True).stdout


@pytest.mark.parametrize("machines", ["slurm"], indirect=True)
def test_what_an_errand_needs_goes_along_whatever_sbatch_passes_on(engine, tmp_path):
    with (tmp_path / "engine.cfg").open("a") as settings:
        settings.write("[slurm]\noptions = --export=NONE\n")
    status, screen = finish(send(engine, "Act", "--act", "succeed"))
    assert status == 0, screen
    assert built() == ["Act succeed"]


def test_what_is_built_into_another_store_is_told(monkeypatch):
    monkeypatch.setattr("pipeline.placing._SECONDS_TO_APPEAR", 0.0)
    with pytest.raises(TaskFailure, match="n1 has built it, or its input, but not into the store"):
        placed(monkeypatch, Act("succeed", executor="ray"), Answers(Outcome("built", "", "n1")))
    (attempt,) = attempts(current_store())
    assert "n1 has built it" in attempt.end, "so that a night can tell"


def test_what_no_node_has_is_not_asked_for():
    """Each node is taken for itself: cards of one and cores of another are no machine."""
    errand = replace(Errand.of(Act("succeed"), "0" * 64, 8 << 30), cores=8, gpus=2)
    nodes = {
        "small": {"CPU": 4.0, "GPU": 1.0, "memory": 4.0 * 2**30},
        "large": {"CPU": 64.0, "memory": 256.0 * 2**30},
    }
    asked = needs(errand, nodes)
    assert asked.pop("label_selector") == {}
    assert asked == {"num_cpus": 4, "num_gpus": 1, "memory": 4 << 30}
    assert needs(replace(errand, gpus=0), nodes)["num_cpus"] == 8
    away = needs(replace(errand, rather_not=("small",)), nodes)
    assert (away["num_cpus"], away["num_gpus"]) == (8, 0)
    assert away["label_selector"] == {"ray.io/node-id": "!in(small)"}
    nowhere = needs(replace(errand, rather_not=("small", "large")), nodes)
    assert nowhere["label_selector"] == {}, "then one of them"
    for growing in ({}, {"head": {"CPU": 0.0, "memory": 2.0**30}}):
        asked = needs(errand, growing)
        assert (asked["num_cpus"], asked["num_gpus"], asked["memory"]) == (8, 2, 8 << 30)


def test_an_errand_is_told_and_read_back():
    errand = Errand.of(Act("succeed"), "0" * 64, 5 << 30)
    assert Errand.from_json(errand.to_json()) == errand
    assert errand.parameters["executor"] == "subprocess", "it is not sent on"


@pytest.mark.parametrize("said", ["", "a line\n", '{"kind": "bui', "Killed\n[]\n"])
def test_a_machine_without_a_last_word_was_lost(said):
    assert outcome_in(said).kind == "killed"


def test_the_last_word_counts():
    assert outcome_in('noise\n{"kind": "built", "host": "n1"}\n\n') == Outcome("built", host="n1")
