"""The bare command, as a user types it, and commands about what it left."""

import contextlib
import json
import os
import pty
import signal
import subprocess
import termios

import psutil
import pytest
from commands import are_gone, luigi, pids_of_slow, pipeline, start
from expected_failures import log_named_in, refuses
from killing import make
from message_words import mentions
from sharing_cases import build
from store_toys import NO_WORD, Batch, Sentence, Slow, Word, built

from pipeline.maintenance.roots import require_single
from pipeline.maintenance.verify import problems
from pipeline.settings import current_store


def test_success_is_quiet_and_quick_again():
    status, screen = luigi("Sentence")
    assert status == 0
    lines = [line for line in screen[: screen.index("===== Luigi")].splitlines() if line]
    assert sorted(line.split(" in ")[0] for line in lines) == [
        f"{name}: {what}"
        for name in ("Sentence", "Word hello", "Word world")
        for what in ("done", "started")
    ]
    status, screen = luigi("Sentence")
    assert status == 0
    assert "started" not in screen
    assert built() == ["Sentence", "Word hello", "Word world"]


def test_a_build_gets_its_upstream_tasks_from_the_graph_of_the_command():
    status, screen = luigi("Account", "--Word-loudness", "3.5")
    assert status == 0, screen
    made = {str(record.provenance["label"]): record for record in current_store().records()}
    artifact = current_store().object(made["Account"].output.digest)
    lineage = json.loads((artifact / "lineage.json").read_text())
    assert [family for family, _, _ in lineage] == ["Word", "Word", "Sentence"]
    assert [parameters["loudness"] for _, parameters, _ in lineage[:2]] == [3.5, 3.5]
    upstream = [made[label].output.digest for label in ("Word hello", "Word world", "Sentence")]
    assert [digest for _, _, digest in lineage] == upstream


def test_a_batch_finishes_what_it_can_and_fails():
    status, screen = luigi("Batch", "--words", '["bad", "good", "crash", "fine"]')
    assert status == 30
    assert {"Word good", "Word fine"} <= set(built())
    assert len(built()) == 4, "a failed task is not tried again"
    assert f"{Word('bad')}: {NO_WORD}\n" in screen
    assert "Traceback" not in screen
    assert "RuntimeError: a defect" in log_named_in(screen).read_text()
    assert [record.provenance["label"] for record in current_store().records()].count(
        "Word bad"
    ) == 0


def test_a_missing_parameter_is_one_line():
    status, screen = luigi("Word")
    assert status == 1
    assert mentions(screen, "Word", "--word")
    assert screen.count("\n") == 1


def test_another_folder_is_reported_at_once(tmp_path, monkeypatch):
    monkeypatch.delenv("STYLETRF_DATA", raising=False)
    status, screen = luigi("Sentence", cwd=tmp_path)
    assert status == 1
    assert mentions(screen, "luigi.cfg", "[store]", tmp_path)
    assert "Traceback" not in screen


@pytest.mark.parametrize("workers", [[], ["--workers", "2"]])
def test_interrupt_ends_all_and_the_next_command_resumes(toys, workers):
    process = start("luigi", "--module", "toys", "Slow", *workers)
    pids = pids_of_slow(toys)
    process.send_signal(signal.SIGINT)
    if workers:  # a terminal sends it to the whole group
        for child in psutil.Process(process.pid).children():
            child.send_signal(signal.SIGINT)
    screen = "".join(process.communicate(timeout=20))
    assert process.returncode not in (0, None)
    assert are_gone(pids)
    if not workers:
        assert "Interrupted" in screen
        assert "Traceback" not in screen
    assert not list(current_store().records())
    status, _ = luigi("Slow")
    assert status == 0
    (record,) = current_store().records()
    artifact = current_store().object(record.output.digest)
    assert [path.name for path in artifact.iterdir()] == ["result.txt"]
    assert not list((current_store().root / "resume").iterdir())
    assert not list((current_store().root / "tmp").iterdir())


@pytest.mark.parametrize("workers", [[], ["--workers", "2"]])
@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGKILL])
def test_a_killed_command_leaves_no_orphan(toys, sent, workers):
    """Its workers are processes of their own, which end with it."""
    process = start("luigi", "--module", "toys", "Slow", *workers)
    pids = pids_of_slow(toys)
    process.send_signal(sent)
    process.communicate(timeout=20)
    assert are_gone(pids)
    assert not list(current_store().records())
    assert luigi("Slow")[0] == 0


def test_a_killed_supervisor_takes_the_builder_along(toys):
    process = start("luigi", "--module", "toys", "Slow")
    builder = pids_of_slow(toys)[0]
    psutil.Process(builder).parent().kill()
    screen = "".join(process.communicate(timeout=20))
    assert process.returncode == 30
    assert are_gone([builder])
    assert mentions(screen, Slow(), "status -9")
    assert log_named_in(screen).is_file()


def test_a_terminal_shows_a_bar_and_then_what_was_done():
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (40, 100))
    command = start("luigi", "--module", "toys", "Lasting", "--steps", "5", stderr=theirs)
    os.close(theirs)
    screen = b""
    with contextlib.suppress(OSError):  # how a terminal says that it was closed
        while part := os.read(ours, 4096):
            screen += part
    os.close(ours)
    command.communicate()
    lines = (
        screen.decode().replace("\r\n", "\n").replace("\x1b[K", "").replace("\r", "\n").split("\n")
    )
    assert any(line.startswith("Lasting:   0%|") for line in lines)
    assert any("loss=" in line and "it/s" in line for line in lines)
    said = [line.split(" in ")[0] for line in lines]
    assert said.index("Lasting: started") < said.index("Lasting: done")


def test_two_commands_at_once_build_an_artifact_once(toys):
    first = start("luigi", "--module", "toys", "Lasting")
    second = start("luigi", "--module", "toys", "Lasting")
    screens = ["".join(process.communicate(timeout=60)) for process in (first, second)]
    assert (first.returncode, second.returncode) == (0, 0), screens
    assert built() == ["Lasting"]
    assert any("Lasting: waiting" in screen for screen in screens)


@pytest.mark.usefixtures("inline")
def test_a_pin_is_of_one_artifact_and_of_its_makers_the_newest():
    for word, loudness in (("hello", 2.0), ("hello", 1.0), ("hello", 3.0), ("bye", 1.0)):
        assert build(Word(word, loudness=loudness))
    made = sorted(current_store().records(), key=lambda r: str(r.provenance["started"]))
    (pinned,) = json.loads(pipeline("pin", made[0].output.digest, "--json")[1])
    assert pinned["key"] == made[2].action.key
    with refuses("Word hello", "Word bye", *(record.action.key[:12] for record in made)):
        require_single(made)


@pytest.mark.usefixtures("inline")
def test_failed_attempts_are_those_that_published_nothing(toys):
    def failed() -> list[tuple[str, str]]:
        rows = json.loads(pipeline("ls", "--failed", "--json")[1])
        return [(row["state"], row["end"]) for row in rows]

    assert not build(Batch(["hello", "bad"]))
    assert failed() == [("ended", NO_WORD)]
    for record in current_store().records():
        current_store().action(record.action.key).unlink()  # as a collection does
    assert len(failed()) == 1, "what was built did not fail"
    process = start("luigi", "--module", "toys", "Slow", stderr=subprocess.DEVNULL)
    pids_of_slow(toys)
    assert [state for state, _ in failed()] == ["ended", "under way"]
    process.kill()
    process.communicate()
    assert are_gone(pids_of_slow(toys))
    assert [state for state, _ in failed()] == ["ended", "ended"]


def test_what_is_no_longer_here_is_shown_so():
    assert build(Word("hello"))
    store = current_store()
    (record,) = store.records()
    gone = {
        "log": store.root / str(record.provenance["log"]),
        "object": store.object(record.output.digest),
    }
    for path in gone.values():
        path.rename(store.root / f"elsewhere {path.name}")
    rows = json.loads(pipeline("show", record.action.key, "--json")[1])
    shown = {row["fact"]: row["value"] for row in rows}
    for fact, path in gone.items():
        assert shown[fact].startswith(f"{path} "), "what is said after the path"


def test_an_artifact_is_not_shown_as_made_from_itself(store):
    """Its bytes are those of its input."""
    source = make(store, "source", "same")
    record = make(store, "copy", "same", inputs=[source])
    said = pipeline("show", record.action.key)[1]
    (line,) = (line for line in said.splitlines() if line.startswith("input"))
    assert mentions(line, "source")
    assert "copy" not in line


@pytest.mark.usefixtures("inline")
def test_ls_show_and_verify_find_an_artifact_and_its_damage():
    assert build(Sentence())
    (record,) = (r for r in current_store().records() if r.action.family == "Sentence")

    status, said = pipeline("ls")
    assert status == 0
    assert said.splitlines()[-1].endswith("Sentence")
    listed = json.loads(pipeline("ls", "Word", "--json")[1])
    assert sorted(row["label"] for row in listed) == ["Word hello", "Word world"]
    for address in (record.action.key[:10], record.output.digest):
        status, said = pipeline("show", address)
        assert status == 0
        assert record.action.key in said
        assert mentions(said, "input word0", "Word hello")
    assert pipeline("show", "nothing")[0] == 2
    assert pipeline("verify", "--deep") == (0, "")
    file = current_store().object(record.output.digest) / "sentence.txt"
    file.chmod(0o644)
    file.write_text("jello world")
    status, said = pipeline("verify")
    assert (status, "writable" in said) == (1, True)
    file.chmod(0o444)
    assert pipeline("verify")[0] == 0, "same length"
    status, said = pipeline("verify", "--deep")
    assert (status, "altered" in said) == (1, True)
    assert len(list(problems(current_store(), deep=True))) == 1
