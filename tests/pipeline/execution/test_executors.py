"""What every executor keeps to, and what only a process of its own can."""

import contextlib
import dataclasses
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from pathlib import Path

import psutil
import pytest
from build_toys import MEBIBYTE, UNREACHABLE
from commands import are_gone, command_server, pids_of_slow
from message_words import mentions
from store_toys import NO_WORD, Word

from pipeline.code.interpreters import interpreter_environment
from pipeline.console.progress import ProgressBar
from pipeline.execution.executors import EXECUTORS, Job, Report
from pipeline.execution.fork_server import current_fork_server, fork_server, forked_by
from pipeline.locks import try_lock
from pipeline.task import artifact


@pytest.fixture
def job(tmp_path: Path) -> Job:
    """A job for `Act`, whose act is still to be chosen."""
    for name in ("out", "resume"):
        (tmp_path / name).mkdir()
    (tmp_path / "log").touch()
    places = {name: str(tmp_path / name) for name in ("out", "resume", "log")}
    return Job("build_toys", "Act", parameters={}, label="Act", inputs={}, **places)


def acted(executor: str, job: Job, act: str, **changes: object) -> Report:
    job = dataclasses.replace(job, parameters={"act": act}, **changes)
    return EXECUTORS[executor](job, ProgressBar("Act", sys.stderr, interactive=False))


def importer(job: Job) -> str:
    return (Path(job.out) / "importer.txt").read_text()


every_executor = pytest.mark.parametrize("executor", sorted(EXECUTORS))


@pytest.fixture(params=["fresh", "forked"])
def _fresh_or_forked(request: pytest.FixtureRequest) -> Iterator[None]:
    """Processes of builds are interpreters of their own, or forks of one that has libraries."""
    with forked_by(command_server()) if request.param == "forked" else contextlib.nullcontext():
        yield


either_process = pytest.mark.usefixtures("_fresh_or_forked")
WAYS = [("inline", "fresh"), ("subprocess", "fresh"), ("subprocess", "forked")]


@either_process
@pytest.mark.parametrize(("executor", "_fresh_or_forked"), WAYS, indirect=["_fresh_or_forked"])
def test_an_act_that_succeeds_is_built_and_its_time_and_memory_are_measured(executor, job):
    report = acted(executor, job, "succeed")
    assert (report.kind, report.status, report.message) == ("built", 0, "")
    assert (Path(job.out) / "whole.txt").exists()
    assert 0 < report.seconds < 30
    assert 5 * MEBIBYTE < report.peak_memory_bytes < 2**40


def test_a_fresh_interpreter_builds():
    Word("a").run()
    assert (artifact(Word("a")) / "word.txt").read_text() == "a"
    record = Word("a").record()
    assert 0 < record.provenance["seconds"] < 30
    assert 5e6 < record.provenance["peak_memory_bytes"] < 1e9


def test_the_end_of_a_build_is_noticed_at_once(job):
    """A command of twenty quick stages would otherwise wait for two seconds in all."""
    specification = Path(job.out).with_name("job.json")
    job = dataclasses.replace(job, parameters={"act": "succeed"})
    specification.write_text(json.dumps(dataclasses.asdict(job)))
    program = (
        "import sys; from pipeline.execution import supervisor\n"
        "supervisor._SECONDS_BETWEEN_POLLS = 60\n"
        "sys.exit(supervisor.supervise(sys.argv[1]))"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, specification],
        env=interpreter_environment(),
        stdin=subprocess.PIPE,
    ) as process:
        assert process.wait(timeout=30) == 0
    assert (Path(job.out) / "whole.txt").exists()


@pytest.mark.usefixtures("forked_builds")
def test_time_before_a_kill_counts_where_a_checkpoint_is_gone_on_from(job):
    resume = Path(job.resume)
    assert acted("subprocess", job, "sleep_a_little").earlier_seconds == 0
    assert not list(resume.iterdir()), "nothing is noted without a checkpoint"
    (resume / "checkpoint").touch()
    (resume / ".seconds").write_text("100.0")
    report = acted("subprocess", job, "sleep_a_little")
    assert (report.earlier_seconds, report.seconds < 30) == (100, True)
    assert 100 < float((resume / ".seconds").read_text()) < 130, "what the next attempt would add"
    (resume / "checkpoint").unlink()
    assert acted("subprocess", job, "succeed").earlier_seconds == 0


@pytest.mark.usefixtures("forked_builds")
def test_cores_of_a_build_and_of_others_are_counted_apart(job):
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as other:
        report = acted("subprocess", job, "sleep_a_little")
        other.kill()
    assert 0 < report.cpu_seconds < report.seconds
    assert report.other_cpu_seconds > 0.3 * report.seconds


@every_executor
@pytest.mark.parametrize("interactive", [False, True])
def test_a_warning_is_a_line_on_the_terminal_and_in_the_log(executor, job, interactive, capfd):
    job = dataclasses.replace(job, parameters={"act": "warn"})
    EXECUTORS[executor](job, ProgressBar("Act", sys.stderr, interactive=interactive))
    said = capfd.readouterr().err.replace("\r", "\n").splitlines()
    assert [line for line in said if "odd" in line] == ["Act: warning: this is odd"]
    assert "Act: warning: this is odd\n" in Path(job.log).read_text()
    assert not any("this is not" in line for line in said)


EXCEPTIONS = {
    "refuse": ("user", NO_WORD, True),
    "crash": ("crash", "RuntimeError: a defect", False),
    "lose": ("transient", "ConnectionResetError: the other side went away", False),
    "lose_once": ("transient", UNREACHABLE, True),
}


@either_process
@pytest.mark.parametrize(
    ("executor", "_fresh_or_forked", "act"),
    [
        (*way, act)
        for way in WAYS
        for act in EXCEPTIONS
        if way != ("subprocess", "fresh") or act == "crash"
    ],
    indirect=["_fresh_or_forked"],
)
def test_an_exception_is_reported_in_its_words_and_traced_in_the_log(executor, job, act):
    kind, words, is_for_the_user = EXCEPTIONS[act]
    report = acted(executor, job, act)
    assert report.kind == kind
    if is_for_the_user:
        assert report.message == words
    else:
        assert mentions(report.message, words, job.log)
    assert report.status != 0
    assert "Traceback" in Path(job.log).read_text()
    assert not (Path(job.out) / "whole.txt").exists()


@either_process
def test_a_long_reason_is_reported_and_blocks_nobody(job):
    """On the pipe it is 96 kB, more than a pipe holds unread."""
    report = acted("subprocess", job, "lament", timeout_seconds=20.0)
    assert (report.kind, report.message) == ("user", "\N{LOUDLY CRYING FACE}" * 8000)


@either_process
@pytest.mark.parametrize(
    ("act", "kind", "status"),
    [
        ("be_killed_while_it_tells", "killed", -9),
        ("be_killed", "killed", -9),
        ("be_terminated", "killed", -15),
        ("leave_with_7", "crash", 7),
        ("leave", "crash", 0),
    ],
)
def test_an_end_without_a_word_is_no_success(job, act, kind, status):
    report = acted("subprocess", job, act)
    assert (report.kind, report.status) == (kind, status)


@either_process
def test_what_a_build_prints_is_in_its_log(job):
    acted("subprocess", job, "be_killed")
    assert "printed by python\nprinted by a library\n" in Path(job.log).read_text()


@either_process
def test_out_of_time_it_ends_with_all_it_started(job, toys):
    report = acted("subprocess", job, "sleep", timeout_seconds=2.0)
    assert (report.kind, report.status) == ("timeout", -9)
    assert 2 < report.seconds < 10
    assert are_gone(pids_of_slow(toys))


@either_process
@pytest.mark.parametrize(
    ("act", "_fresh_or_forked"),
    [("let_a_child_eat", "fresh"), ("let_an_outsider_eat", "forked")],
    indirect=["_fresh_or_forked"],
)
def test_the_memory_of_what_it_starts_counts(job, act):
    """Also of what begins a session of its own, as torchrun's processes do."""
    assert acted("subprocess", job, act).peak_memory_bytes > 200 * MEBIBYTE
    report = acted("subprocess", job, act, memory_limit_bytes=150 * MEBIBYTE)
    assert (report.kind, report.status) == ("memory", -9)
    assert report.peak_memory_bytes > 150 * MEBIBYTE


@pytest.fixture
def cramped() -> Iterator[Path]:
    """A control group whose processes may take 150 MiB together; the kernel sees to it."""
    for parent, limit in (("memory", "memory.limit_in_bytes"), (".", "memory.max")):
        group = Path("/sys/fs/cgroup", parent, f"styletrf-{os.getpid()}")
        try:
            group.mkdir()
            (group / limit).write_text(str(150 * MEBIBYTE))
        except OSError:
            with contextlib.suppress(OSError):
                group.rmdir()
            continue
        yield group
        while (group / "cgroup.procs").read_text():
            time.sleep(0.05)
        group.rmdir()
        return
    pytest.skip("needs the right to make a control group")


def test_the_kernels_own_limit_is_recognized(job, cramped):
    """In a small process of its own: the kernel kills the largest, which must be the build."""
    program = (
        "import json, os, pathlib, sys\n"
        "pathlib.Path(sys.argv[1], 'cgroup.procs').write_text(str(os.getpid()))\n"
        "from pipeline.execution.executors import EXECUTORS, Job\n"
        "from pipeline.console.progress import ProgressBar\n"
        "job, bar = Job(**json.loads(sys.argv[2])), ProgressBar('', sys.stderr, interactive=0)\n"
        "print(EXECUTORS['subprocess'](job, bar).kind)\n"
    )
    job = dataclasses.replace(job, parameters={"act": "eat"})
    said = subprocess.run(
        [sys.executable, "-c", program, cramped, json.dumps(dataclasses.asdict(job))],
        env=interpreter_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (said.returncode, said.stdout) == (0, "memory\n"), said.stderr


def test_within_its_limits_it_is_left_alone(job):
    report = acted(
        "subprocess", job, "succeed", timeout_seconds=60.0, memory_limit_bytes=1000 * MEBIBYTE
    )
    assert report.kind == "built"


@either_process
def test_a_build_sees_the_environment_it_is_given(job, monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "the user's choice")
    for given, seen in ({"CUDA_VISIBLE_DEVICES": "GPU-7"}, "GPU-7"), ({}, "the user's choice"):
        assert acted("subprocess", job, "succeed", environment=given).kind == "built"
        assert (Path(job.out) / "whole.txt").read_text() == seen


@either_process
def test_a_build_holds_the_lease_itself(job, tmp_path, toys):
    """Ours is closed while it runs; the GPU is free only when it has ended."""
    import threading

    mine, others = (os.open(tmp_path / "log", os.O_RDONLY) for _ in range(2))
    assert try_lock(mine)
    run = threading.Thread(
        target=copy_context().run,
        args=(acted, "subprocess", job, "sleep"),
        kwargs={"inherited_fds": (mine,)},
    )
    run.start()
    builder = pids_of_slow(toys)[0]
    os.close(mine)
    assert not try_lock(others)
    os.kill(builder, 9)
    run.join()
    assert try_lock(others)
    os.close(others)


@pytest.mark.parametrize("libraries", [[], ["imported_toy"], ["no_such_library", "imported_toy"]])
def test_a_forked_build_finds_the_libraries_imported(job, libraries):
    with fork_server(libraries):
        assert acted("subprocess", job, "import_a_library").kind == "built"
    assert importer(job) == ("server" if libraries else "it")


def test_a_build_with_cores_of_its_own_starts_an_interpreter(job):
    with fork_server(["imported_toy"]):
        acted("subprocess", job, "import_a_library", environment={"OMP_NUM_THREADS": "1"})
    assert importer(job) == "it"


def test_builds_go_on_after_their_fork_server_was_killed(job):
    others = psutil.Process().children()
    with fork_server(["wave"]):
        for _ in range(2):
            assert acted("subprocess", job, "succeed").kind == "built"
            for process in set(psutil.Process().children()).difference(others):
                process.kill()
                process.wait()


def test_a_fork_server_ends_with_its_command(job):
    others = psutil.Process().children()
    with fork_server(["wave"]):
        acted("subprocess", job, "succeed")
        (server,) = set(psutil.Process().children()).difference(others)
    assert current_fork_server() is None
    assert not server.is_running()


def test_a_killed_supervisor_that_was_forked_is_reported_with_its_signal(job, toys):
    with fork_server(["wave"]), ThreadPoolExecutor() as pool:
        report = pool.submit(copy_context().run, acted, "subprocess", job, "sleep")
        builder = pids_of_slow(toys)[0]
        psutil.Process(builder).parent().kill()
        assert (report.result().kind, report.result().status) == ("crash", -9)
    assert are_gone([builder])
