"""What Luigi does when things go wrong, through the command line as a user meets it."""

import json
import signal
import time
from pathlib import Path

import luigi as luigi_package
import psutil
import pytest
from build_toys import Act
from commands import are_gone, pids_of_slow, start
from message_words import mentions
from store_toys import NO_WORD, built

from pipeline.settings import current_store
from pipeline.store import FORMAT


def luigi(*arguments: str) -> tuple[int, str]:
    """Exit status and screen of `luigi --module build_toys ...`."""
    process = start("luigi", "--module", "toys", *arguments)
    screen = "".join(process.communicate(timeout=60))
    return process.returncode, screen


@pytest.mark.parametrize(
    ("arguments", "status", "named"),
    [
        (["Act", "--act", "succeed"], 0, ["Act succeed: done"]),
        (["WithGiven", "--path", "/nowhere"], 20, ["Given(path=/nowhere)"]),
        (["Greedy", "--word", "a"], 25, ["Greedy(word=a, loudness=1.0)"]),
        (["Act", "--act", "refuse"], 30, ["Act(act=refuse)", NO_WORD]),
        (["Act", "--act", "crash"], 30, ["Act(act=crash)", "RuntimeError: a defect"]),
        (["Act", "--act", "be_killed"], 30, ["Act(act=be_killed)", "SIGKILL"]),
        (["Act", "--act", "sleep", "--timeout-seconds", "1"], 30, ["--Act-timeout-seconds"]),
        (["Act", "--act", "eat", "--Act-memory-gib", "0.2"], 30, ["--Act-memory-gib"]),
        (["Forgetful", "--word", "a"], 30, ["complete()"]),
        (["Rootless", "--word", "a"], 35, ["a defect in requires"]),
        (["Act"], 1, ["Act", "--act"]),
        (["Act", "--act", "succeed", "--timeout-seconds", "soon"], 1, ["--timeout-seconds soon"]),
        (["Act", "--act", "succeed", "--workers", "two"], 1, ["--workers two"]),
        (["Atc", "--act", "succeed"], 1, ["Atc", "Act"]),
        (["Act", "--act", "succeed", "--loud"], 2, ["--loud"]),
    ],
)
def test_the_status_tells_how_it_ended(arguments, status, named):
    found, screen = luigi(*arguments)
    assert found == status, screen
    assert mentions(screen, *named)
    assert status == 35 or arguments[0] == "Forgetful" or "Traceback" not in screen


def test_failures_are_found_again_without_the_screen():
    for act in ("succeed", "refuse", "be_killed"):
        luigi("Act", "--act", act)
    listed = json.loads(start("pipeline", "ls", "Act", "--failed", "--json").communicate()[0])
    refused, killed = (row["end"] for row in listed)
    assert refused == NO_WORD
    assert mentions(killed, "SIGKILL")
    assert all("printed by python" in Path(row["log"]).read_text() for row in listed)
    (record,) = current_store().records()
    shown = json.loads(start("pipeline", "show", record.action.key, "--json").communicate()[0])
    (log,) = (row["value"] for row in shown if row["fact"] == "log")
    assert "printed by python" in Path(log).read_text()


def test_a_store_that_cannot_be_used_is_a_failure_in_one_line():
    """`complete()` meets it first, and must not raise."""
    root = current_store().root
    (root / "format").write_text("styletrf store 99\n")
    status, screen = luigi("Act", "--act", "succeed")
    assert status == 30
    assert mentions(screen, root, "styletrf store 99", FORMAT.strip())
    assert "Traceback" not in screen


def test_settings_and_words_of_a_family_limit_its_builds(tmp_path, monkeypatch):
    (tmp_path / "limits.cfg").write_text("[Act]\ntimeout_seconds = 1\n")
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(tmp_path / "limits.cfg"))
    assert mentions(luigi("Act", "--act", "sleep")[1], "--Act-timeout-seconds")
    (tmp_path / "limits.cfg").write_text("[store]\nmemory_gib = 0.2\n")
    assert mentions(luigi("Act", "--act", "eat")[1], "--Act-memory-gib")


@pytest.mark.parametrize("words", [[], ["--worker-keep-alive"]])
def test_a_missing_input_ends_the_batch_and_the_rest_is_done(words, tmp_path):
    words = [*words, "--worker-max-keep-alive-idle-duration", "2 seconds"]
    status, screen = luigi("WithGiven", "--path", str(tmp_path / "given"), *words)
    assert status == 20, screen
    assert mentions(screen, f"Given(path={tmp_path / 'given'})")
    assert built() == ["Word a"]
    (tmp_path / "given").touch()
    assert luigi("WithGiven", "--path", str(tmp_path / "given"), *words)[0] == 0


def test_waiting_for_a_missing_input_is_bounded_by_default():
    from luigi.worker import worker

    assert worker().max_keep_alive_idle_duration.total_seconds() == 600


@pytest.mark.parametrize("workers", ["1", "2"])
def test_a_batch_with_one_bad_part_finishes_the_others(workers, tmp_path, monkeypatch):
    (tmp_path / "impatient.cfg").write_text("[store]\nretry_seconds = 0.1\n")
    monkeypatch.setenv("LUIGI_CONFIG_PATH", str(tmp_path / "impatient.cfg"))
    acts = '["succeed", "refuse", "lose_once"]'
    status, screen = luigi("Acts", "--acts", acts, "--workers", workers)
    assert status == 30
    assert f"{Act('refuse')}: {NO_WORD}\n" in screen
    assert "1 failed" in screen
    assert {r.provenance["label"] for r in current_store().records()} == {
        "Act succeed",
        "Act lose_once",
    }


def test_one_key_for_numbers_that_are_one():
    assert luigi("Word", "--word", "a", "--loudness", "1")[0] == 0
    assert luigi("Word", "--word", "a", "--loudness", "1.0")[0] == 0
    assert luigi("Word", "--word", "a", "--loudness", "10e-1")[0] == 0
    assert built() == ["Word a"]


def test_one_key_for_dictionaries_that_are_one():
    for words in ('{"x": 1, "y": [2.0]}', '{"y": [2], "x": 1.0}'):
        assert luigi("Settled", "--settings", words)[0] == 0
    assert built() == ["Settled"]


def test_a_task_whose_inputs_come_out_the_same_is_not_built_again():
    """Luigi runs what was incomplete at the start; `run` finds that it is not needed."""
    assert luigi("Echo", "--edition", "1")[0] == 0
    status, screen = luigi("Echo", "--edition", "2")
    assert status == 0
    assert built() == ["Echo", "Said", "Said"]
    assert "Echo: started" not in screen


def test_ctrl_c_with_workers_is_one_line(toys):
    process = start("luigi", "--module", "toys", "Act", "--act", "sleep", "--workers", "2")
    pids = pids_of_slow(toys)
    for member in [*psutil.Process(process.pid).children(), psutil.Process(process.pid)]:
        member.send_signal(signal.SIGINT)  # as a terminal does, and a busy machine delivers it
        time.sleep(0.5)
    screen = "".join(process.communicate(timeout=20))
    assert process.returncode not in (0, None)
    assert are_gone(pids)
    started, end = [line for line in screen.splitlines() if line]
    assert started == "Act sleep: started"
    assert end.startswith("Interrupted")


@pytest.mark.parametrize("attempt", [1, 2])
def test_what_a_test_registers_and_instantiates_is_gone_after_it(attempt):
    from store_toys import Word

    class Passing(luigi_package.Task):
        pass

    found = luigi_package.task_register.Register.get_task_cls("Passing")  # ambiguous if two
    assert found is Passing
    assert not hasattr(Word("a"), "attempt")
    Word("a").attempt = attempt
    assert Word("a").attempt == attempt, "one instance within a test"
