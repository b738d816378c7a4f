"""What surrounds Luigi in a command: its order, its ends, and its exit status."""

import json
import logging
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from commands import ROOT, SUPPORT, pids_of_slow, start
from forked_modules import ForkedModule
from message_words import mentions
from store_toys import built

from pipeline import command
from pipeline.command import run_command
from pipeline.console.log_handler import ConsoleHandler
from pipeline.maintenance import command_line


def run(
    *arguments: str, refusal: str = "", status: int | None = None, folder: Path = ROOT
) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command in a folder."""
    process = begun(*arguments, refusal=refusal, status=status, folder=folder)
    output, errors = process.communicate(timeout=60)
    return process.returncode, output, errors


def begun(
    *arguments: str, refusal: str = "", status: int | None = None, folder: Path = ROOT
) -> ForkedModule:
    """A command in a folder, see `surrounded_command`."""
    return start("surrounded_command", refusal, json.dumps(status), *arguments, cwd=folder)


def test_begin_comes_first_and_end_last():
    status, output, _ = run("Word", "--word", "hello")
    assert (status, output.split()) == (0, ["begin", "Word", "end", "complete"])
    assert built() == ["Word hello"]


def test_a_command_has_a_fork_server_of_its_own():
    code = (
        "import sys, store_toys; from pipeline.command import run_command\n"
        "from pipeline.execution.fork_server import current_fork_server as server\n"
        "begin = lambda task: print(server() is not None)\n"
        "sys.exit(run_command(sys.argv[1:], begin, lambda task: None, ['wave']))"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(SUPPORT)])}
    command = [sys.executable, "-c", code, "Word", "--word", "hello"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, check=True)
    assert done.stdout == b"True\n"


def test_end_is_called_after_a_failure_and_luigi_has_the_status():
    status, output, _ = run("Word", "--word", "bad")
    assert (status, output.split()[-2:]) == (30, ["end", "incomplete"])


def test_the_status_of_end_replaces_that_of_luigi():
    assert run("Word", "--word", "bad", status=31)[0] == 31
    assert run("Word", "--word", "bad", status=0)[0] == 0


def test_a_command_that_begin_refuses_builds_nothing_and_has_no_end():
    status, output, errors = run("Word", "--word", "hello", refusal="this is refused")
    assert (status, output.split()) == (1, ["begin", "Word"])
    assert errors == "this is refused\n"
    assert built() == []


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["Wrod"], 1),  # no such task
        (["Word"], 1),  # a parameter is missing
        (["Word", "--word", "a", "--memory-gib", "b"], 1),  # a parameter that is no number
        (["Word", "--word", "a", "--volume", "1"], 2),  # no such parameter
    ],
)
def test_a_command_that_luigi_cannot_read_has_neither_begin_nor_end(arguments, status):
    found, output, errors = run(*arguments)
    assert (found, output) == (status, "")
    assert errors
    assert "Traceback" not in errors


def test_a_command_with_neither_settings_nor_data_is_refused(tmp_path, monkeypatch):
    monkeypatch.delenv("STYLETRF_DATA", raising=False)
    status, output, _ = run("Word", "--word", "hello", folder=tmp_path)
    assert (status, output) == (1, "")
    assert built() == []


@pytest.mark.parametrize("settings", [None, "[store]\nretry_seconds = 0\n"])
def test_a_folder_of_data_needs_no_settings_of_luigi(settings, tmp_path, monkeypatch):
    """Commands of an installed package end, and tell of it, as those in the repository do."""
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    if settings:
        (tmp_path / "luigi.cfg").write_text(settings)
    here, there = (run("Word", "--word", "bad", folder=folder) for folder in (tmp_path, ROOT))
    assert here[:2] == there[:2] == (30, "begin Word\nend incomplete\n")
    assert len(here[2].splitlines()) == len(there[2].splitlines()), here[2]
    assert run("Word", "--word", "hello", folder=tmp_path)[0] == 0
    assert "Word hello" in built()


@pytest.mark.parametrize("status", [None, 0, 31])
def test_an_interrupted_command_ends_with_130_whatever_end_returns(toys, status):
    """A grid that had made some cells ended with 31, as if others had failed."""
    process = begun("Slow", status=status)
    pids_of_slow(toys)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=20)
    assert (process.returncode, output.split()[-2:]) == (130, ["end", "incomplete"])
    assert "Traceback" not in errors


def test_a_package_imported_by_any_other_program_takes_nothing_over():
    code = "import toys; print('imported')"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(SUPPORT)])}
    command = [sys.executable, "-c", code, "Word", "--word", "hello"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, check=True)
    assert done.stdout == b"imported\n"
    assert built() == []


def test_an_attempt_leaves_its_outcome_beside_its_log():
    from pipeline.settings import current_store

    run("Word", "--word", "hello")
    run("Word", "--word", "bad")
    outcomes = [json.loads(p.read_text()) for p in (current_store().root / "logs").rglob("*.json")]
    assert sorted(outcome["kind"] for outcome in outcomes) == ["built", "user"]
    assert all(outcome["reason"] for outcome in outcomes)


@pytest.mark.parametrize(
    ("section", "line"),
    [
        ("store", "memory_gib = lots"),
        ("store", "patience_seconds = long"),
        ("store", "retry_seconds = -1"),
        ("store", "checkpoint_seconds = nan"),
        ("store", "push = maybe"),
        ("store", "locks ="),
        ("store", "executor = foo"),
        ("host", "cores = two"),
        ("host", "memory_gib = lots"),
    ],
)
def test_a_setting_of_another_kind_is_one_line_before_the_begin(
    tmp_path, monkeypatch, section, line
):
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    (tmp_path / "luigi.cfg").write_text(f"[{section}]\n{line}\n")
    status, output, errors = run("Word", "--word", "hello", folder=tmp_path)
    assert (status, output, errors.count("\n")) == (1, "", 1), errors
    assert mentions(errors, f"[{section}]", line, "luigi.cfg")
    assert built() == []


def test_a_secret_setting_that_cannot_be_read_is_one_line_without_it(tmp_path, monkeypatch):
    """The command failed after a whole grid, with a part of the address."""
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    (tmp_path / "luigi.cfg").write_text("[grid]\nwebhook = https://example.org/a%secret\n")
    status, output, errors = run("Word", "--word", "hello", folder=tmp_path)
    assert (status, output, errors.count("\n")) == (1, "", 1), errors
    assert mentions(errors, "[grid] webhook", "luigi.cfg")
    assert "secret" not in errors


def test_help_needs_neither_settings_nor_data(tmp_path, monkeypatch):
    monkeypatch.delenv("STYLETRF_DATA", raising=False)
    status, output, _ = run("Word", "--help", folder=tmp_path)
    assert status == 0
    assert "--word" in output


def test_an_address_of_luigid_in_the_users_settings_is_used(tmp_path, monkeypatch):
    """The settings of the package would have built alone, without asking it."""
    (tmp_path / "data").mkdir()
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path / "data"))
    luigid = "scheduler_url = http://127.0.0.1:9\nrpc_retry_attempts = 1\nrpc_retry_wait = 0\n"
    (tmp_path / "luigi.cfg").write_text(f"[core]\n{luigid}")
    status, _, errors = run("Word", "--word", "hello", folder=tmp_path)
    assert status != 0
    assert "127.0.0.1:9" in errors
    assert built() == []


@pytest.mark.parametrize(
    ("options", "is_local"),
    [
        (["--scheduler-url", "http://127.0.0.1:9"], False),
        (["--scheduler-host", "127.0.0.1", "--scheduler-port", "9"], False),
        (["--scheduler-url", "http://127.0.0.1:9", "--local-scheduler"], True),
    ],
)
def test_a_luigid_that_the_command_names_is_used_unless_it_is_to_run_alone(
    tmp_path, monkeypatch, options, is_local
):
    """Machines that named one luigid built the same artifacts."""
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path))
    settings = "local_scheduler = true\nrpc_retry_attempts = 1\nrpc_retry_wait = 0\n"
    (tmp_path / "luigi.cfg").write_text(f"[core]\n{settings}")
    status, _, _ = run("Word", "--word", "hello", *options, folder=tmp_path)
    assert (status == 0) == is_local
    assert built() == ["Word hello"] * is_local


@pytest.mark.parametrize(
    ("run_here", "status"),
    [
        (lambda: run_command(["Wrod"], print, print), 1),
        (lambda: command_line.main(["ls"]), 2),
    ],
    ids=["luigi", "pipeline"],
)
def test_a_command_without_standard_error_has_its_status(monkeypatch, run_here, status):
    """`2>&-` closes it; what would be written there is lost, and nothing else."""
    monkeypatch.setattr(command, "_complete_settings", lambda: None)
    monkeypatch.setattr(sys, "stderr", None)
    assert run_here() == status
    ConsoleHandler().emit(logging.makeLogRecord({"msg": "nobody reads this"}))
    sys.stderr.close()
