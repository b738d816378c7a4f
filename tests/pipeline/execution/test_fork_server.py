"""A question to a function in a process that a server has forked, or in a new interpreter."""

import os
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from pathlib import Path

import psutil
import pytest

from pipeline.execution.fork_server import current_fork_server, fork_server, output_of


@pytest.mark.parametrize("libraries", [[], ["imported_toy"]])
@pytest.mark.parametrize("question", ["", "what is this?", "long" * 2**16])
def test_an_answer_is_what_the_function_wrote(libraries, question):
    with fork_server(libraries):
        importer, _, text = output_of("imported_toy:repeat", question).partition(" ")
    assert text == question
    assert importer == ("server" if libraries else "itself")


def test_a_function_that_reads_nothing_answers_all_the_same():
    with fork_server(["wave"]):
        assert output_of("imported_toy:say_hello", "long" * 2**18) == "hello"


@pytest.mark.parametrize("libraries", [[], ["imported_toy"]])
@pytest.mark.parametrize("function", ["fail", "end"])
def test_a_function_that_fails_gives_no_answer(libraries, function):
    """An empty answer passed for one that found nothing wrong."""
    with fork_server(libraries), pytest.raises(RuntimeError, match=f"imported_toy:{function}"):
        output_of(f"imported_toy:{function}", "what?")


def test_questions_are_answered_after_the_server_was_killed():
    others = psutil.Process().children()
    with fork_server(["wave"]):
        assert output_of("imported_toy:say_hello", "") == "hello"
        for process in set(psutil.Process().children()).difference(others):
            process.kill()
            process.wait()
        assert output_of("imported_toy:say_hello", "") == "hello"


def test_a_server_that_ends_before_it_forks_is_replaced_by_an_interpreter(tmp_path, monkeypatch):
    (tmp_path / "aborting_library.py").write_text("import os; os.abort()")
    monkeypatch.syspath_prepend(tmp_path)
    with fork_server(["aborting_library"]):
        assert output_of("imported_toy:repeat", "what?") == "itself what?"


def test_a_request_too_large_for_the_server_goes_to_an_interpreter(monkeypatch):
    monkeypatch.setenv("LARGE", "x" * 100_000)
    with fork_server(["imported_toy"]):
        assert output_of("imported_toy:repeat", "what?") == "server what?"
        monkeypatch.setenv("LARGER", "x" * 60_000)
        assert output_of("imported_toy:repeat", "what?") == "itself what?"


def test_a_fork_is_in_the_folder_of_the_command(tmp_path, monkeypatch):
    with fork_server(["imported_toy"]):
        output_of("imported_toy:say_hello", "")
        monkeypatch.chdir(tmp_path)
        assert output_of("imported_toy:say_where", "") == str(tmp_path)


def test_a_fork_imports_the_code_as_it_is_then(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    with fork_server(["wave"]):
        for answer in ("old", "newer"):
            code = f"def say() -> int:\n    print({answer!r}, end='')\n    return 0\n"
            (tmp_path / "edited_toy.py").write_text(code)
            assert output_of("edited_toy:say", "") == answer


def test_processes_that_end_in_any_order_keep_their_own_results():
    with fork_server(["wave"]), ThreadPoolExecutor(4) as pool:
        output_of("imported_toy:say_hello", "")
        questions = ["long" * 2**15, "short", "long" * 2**14, ""]
        answers = [
            pool.submit(copy_context().run, output_of, "imported_toy:repeat", question)
            for question in questions
        ]
        found = [answer.result().partition(" ")[2] for answer in answers]
    assert found == questions


def test_a_server_outlives_a_worker_that_waited_for_one_of_its_processes():
    """It ended when it sent the status, and with it the builds of the other workers."""
    with fork_server(["imported_toy"]), Path(os.devnull).open("r+") as nothing:
        server = current_fork_server()
        streams = (nothing.fileno(),) * 3
        server.start("imported_toy:end", (), os.environ, streams).statuses.close()
        assert server.start("imported_toy:end", (), os.environ, streams).wait() == 3
        assert output_of("imported_toy:repeat", "what?") == "server what?"
