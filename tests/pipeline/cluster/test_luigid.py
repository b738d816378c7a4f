"""Several commands under a real luigid, some of them killed."""

import configparser
import json
import re
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import luigi
import pytest
from commands import ROOT, are_gone, pids_of_slow, start
from forked_modules import ForkedModule
from luigid_process import Luigid
from message_words import mentions
from small_disk import small_disk
from store_toys import built

from pipeline.maintenance.verify import problems
from pipeline.settings import current_store


@pytest.fixture
def luigid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Luigid]:
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(tmp_path / "cluster.cfg"))
    scheduler = Luigid(tmp_path)
    yield scheduler
    scheduler.kill()


def worker(*arguments: str) -> ForkedModule:
    return start("luigi", "--module", "toys", *arguments)


def finish(process: ForkedModule) -> tuple[int, str]:
    screen = "".join(process.communicate(timeout=60))
    return process.returncode, screen


@pytest.mark.usefixtures("luigid")
def test_two_workers_build_a_batch_once():
    """Status 10 and 25 mean that the other worker built, or is building, a part."""
    words = ["Acts", "--acts", '["succeed", "sleep_a_little"]']
    outcomes = [finish(process) for process in [worker(*words), worker(*words)]]
    assert {status for status, _ in outcomes} <= {0, 10, 25}, outcomes
    assert built() == ["Act sleep_a_little", "Act succeed"]


def scheduler_of(luigid: Luigid) -> luigi.rpc.RemoteScheduler:
    return luigi.rpc.RemoteScheduler(f"http://127.0.0.1:{luigid.port}/")


def test_another_worker_finishes_the_build_of_a_killed_worker(luigid, toys):
    lost = worker("SlowBatch")
    pids = pids_of_slow(toys)
    other = worker("SlowBatch")
    while [each["num_pending"] for each in scheduler_of(luigid).worker_list()] != [1, 1]:
        time.sleep(0.1)  # until it waits for the batch, too
    lost.kill()
    lost.communicate()
    assert are_gone(pids)
    status, screen = finish(other)
    assert status in (0, 10), screen
    assert built() == ["Slow sleep"] * 2, "the other one began it again"
    (record,) = current_store().records()
    artifact = current_store().object(record.output.digest)
    assert (artifact / "result.txt").read_text() == "resumed"
    assert not list(problems(current_store(), deep=True))


def test_a_build_outlives_a_killed_luigid(luigid):
    process = worker("Lasting", "--steps", "20")
    while not built():
        time.sleep(0.02)
    luigid.kill()
    status, screen = finish(process)
    assert status == 40
    (record,) = current_store().records()
    assert record.action.family == "Lasting"
    assert mentions(screen, f"http://127.0.0.1:{luigid.port}")
    assert "Traceback" not in screen
    luigid.start()
    status, screen = finish(worker("Lasting", "--steps", "20"))
    assert status == 0
    assert "Lasting: " not in screen
    assert built() == ["Lasting"]


def test_a_command_goes_on_when_luigid_is_back(luigid, toys):
    process = worker("OnGpu", "--name", "a", "--awaited", "back", "--device", "cpu")
    while not (toys / "began-a").exists():
        time.sleep(0.02)
    luigid.kill()
    luigid.start()
    (toys / "back").touch()
    status, screen = finish(process)
    assert status == 0, screen
    assert screen.count(": started\n") == 1


def restart_while_it_builds(luigid: Luigid, n_begun: int = 1) -> None:
    while len(built()) < n_begun:
        time.sleep(0.02)
    luigid.kill()
    luigid.start()


@pytest.fixture
def patient(luigid: Luigid) -> Luigid:
    """Commands wait for this luigid longer than it takes to start."""
    settings = luigid.config.read_text()
    assert "rpc-retry-attempts = 2" in settings
    luigid.config.write_text(settings.replace("rpc-retry-attempts = 2", "rpc-retry-attempts = 60"))
    return luigid


def test_a_command_asks_a_restarted_luigid_again(patient):
    """It restarts during the first of several builds; the command builds the others, too."""
    process = worker("Steps", "--names", '["a", "b", "c"]')
    restart_while_it_builds(patient)
    status, screen = finish(process)
    assert status == 0, screen
    assert sum(mentions(line, "luigid") for line in screen.splitlines()) == 1, screen
    assert built() == ["Large a", "Large b", "Large c"]
    assert screen.count("whole") == 1, "only the last run of the command ends it"


def test_an_interrupted_command_does_not_restart(patient, toys):
    process = worker("Steps", "--names", '["a", "b"]', "--acts", '["sleep"]', "--workers", "3")
    restart_while_it_builds(patient, n_begun=3)
    while process.poll() is None:  # again, where the worker was waiting for luigid
        process.send_signal(signal.SIGINT)
        time.sleep(1)
    _, screen = finish(process)
    assert "Interrupted" in screen
    assert not mentions(screen, "luigid")
    assert "whole" not in screen
    assert len(built()) == 3, "no further build started"


@pytest.mark.usefixtures("luigid")
def test_a_command_with_a_full_disk_leaves_the_rest_to_others(tmp_path, monkeypatch):
    """It requests no more tasks after the first failure; otherwise it would fail all of them."""
    (tmp_path / "shared").mkdir()
    monkeypatch.setenv("STYLETRF_REMOTE", str(tmp_path / "shared"))
    names = list("abcdefgh")
    with small_disk(tmp_path / "full", mebibytes=3):
        monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / "full" / "store"))
        full = worker("Larges", "--names", json.dumps(names))
        while not built():  # so that the other one leaves it enough to fill the disk
            time.sleep(0.02)
        monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / "roomy"))
        roomy = worker("Larges", "--names", json.dumps(names))
        (_, screen), (status, other) = finish(full), finish(roomy)
        assert screen.count("STYLETRF_STORE") == 1, screen
        assert mentions(screen, "luigid")
        assert status in (0, 10, 25), other
        left = built()
        assert sorted({*left}) == [f"Large {name}" for name in names]
        assert len(left) == len(names) + 1, "one was started twice, and none was lost"
        assert not list(problems(current_store(), deep=True))


def test_commands_wait_for_a_shared_store_that_fails_for_a_while(
    luigid, proxied, tmp_path, monkeypatch
):
    """Otherwise each machine would build what the other one has built."""
    _, proxy = proxied
    settings = luigid.config.read_text()
    assert "patience_seconds = 300" in settings
    words = ["Larges", "--names", json.dumps(list("abcd"))]
    commands = []
    for name in ("one", "other"):
        monkeypatch.setenv("STYLETRF_STORE", str(tmp_path / name))
        commands.append(worker(*words))
    while not built():
        time.sleep(0.02)
    end = time.monotonic() + 5
    proxy.fault = lambda _method, _path: 500 if time.monotonic() < end else None
    outcomes = [finish(command) for command in commands]
    assert {status for status, _ in outcomes} <= {0, 10, 25}, outcomes
    assert any(mentions(screen, "300 s") for _, screen in outcomes), outcomes
    assert built() == [f"Large {name}" for name in "abcd"]


def test_a_missing_input_ends_the_batch(luigid, tmp_path):
    luigid.config.write_text(luigid.config.read_text().replace("5 seconds", "1 second"))
    status, screen = finish(worker("WithGiven", "--path", str(tmp_path / "given")))
    assert status == 20, screen
    assert built() == ["Word a"]


@pytest.mark.usefixtures("luigid")
def test_a_failure_is_tried_twice_and_reported():
    status, screen = finish(worker("Acts", "--acts", '["crash", "succeed"]'))
    assert status == 30, screen
    assert built() == ["Act crash", "Act crash", "Act succeed"], "a machine may have been lost"


@pytest.mark.usefixtures("luigid")
def test_the_next_command_builds_what_failed_before_its_repair(toys):
    """Luigi alone would let no command try it for a day."""
    words = ["Steps", "--names", '["a"]', "--acts", '["refuse_until_mended"]']
    status, screen = finish(worker(*words))
    assert status == 30, screen
    assert built() == ["Act refuse_until_mended"] * 2 + ["Large a"]
    (toys / "mended").touch()
    status, screen = finish(worker(*words))
    assert status == 0, screen
    assert built() == ["Act refuse_until_mended"] * 3 + ["Large a"]


def test_a_slow_answer_does_not_make_a_worker_lost():
    settings = configparser.ConfigParser()
    settings.read(ROOT / "luigi.cluster.cfg")
    assert settings.getint("scheduler", "worker_disconnect_delay") >= 600
    assert settings.getint("scheduler", "retry_count") == 2


def test_an_idle_worker_stays_until_it_can_take_over_from_a_lost_one():
    settings = configparser.ConfigParser()
    settings.read(ROOT / "luigi.cluster.cfg")
    times = settings["scheduler"]
    delays = times.getint("worker_disconnect_delay"), times.getint("retry_delay")
    until_free = sum(delays) + 60  # pruning
    idle = luigi.TimeDeltaParameter().parse(settings["worker"]["max_keep_alive_idle_duration"])
    assert idle.total_seconds() > 4 * until_free


def test_a_machine_with_other_code_is_refused(luigid, toys):
    """Another salt stands for another commit: the same task, another key."""
    first = worker("HelloAndSlow", "--workers", "2")
    pids_of_slow(toys)
    while not list(current_store().records()):
        time.sleep(0.02)
    settings = luigid.config.read_text()
    luigid.config.write_text(settings.replace("[store]", "[store]\nsalt = another"))
    status, screen = finish(worker("Sentence", "--words", '["hello"]'))
    first.kill()
    first.communicate()
    (record,) = current_store().records()
    assert mentions(screen, socket.gethostname(), record.action.key[:16]), screen
    assert status == 30
    assert record.action.salt == ""
    assert not list(problems(current_store(), deep=True))


def test_the_page_of_luigid_shows_progress_and_keys(luigid, monkeypatch):
    monkeypatch.setenv("TOYS_SECONDS_BETWEEN_REPORTS", "0.2")
    process = worker("Lasting", "--steps", "20")
    scheduler, seen, messages = scheduler_of(luigid), set(), set()
    while process.poll() is None:
        for name in scheduler.task_list("RUNNING", ""):
            seen.add(scheduler.get_task_progress_percentage(name)["progressPercentage"])
            messages.add(scheduler.get_task_status_message(name)["statusMessage"])
        time.sleep(0.2)
    finish(process)
    assert {p for p in seen if p and 0 < p < 100}
    messages.discard(None)  # luigid knows that a task runs before the worker says more
    assert messages
    assert all(json.loads(message)["key"] for message in messages)


def test_a_command_without_luigid_asks_none_at_its_end():
    status, screen = finish(worker("Steps", "--names", '["a"]'))
    assert status == 0, screen
    assert "whole" in screen
    assert not re.search(r"https?://", screen)
