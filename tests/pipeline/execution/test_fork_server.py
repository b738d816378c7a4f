"""A question to a function in a process that a server has forked, or in a new interpreter."""

import psutil
import pytest

from pipeline.execution.fork_server import answer_of, fork_server


@pytest.mark.parametrize("libraries", [[], ["imported_toy"]])
@pytest.mark.parametrize("question", ["", "what is this?", "long" * 2**16])
def test_an_answer_is_what_the_function_wrote(libraries, question):
    with fork_server(libraries):
        importer, _, text = answer_of("imported_toy:repeat", question).partition(" ")
    assert text == question
    assert importer == ("server" if libraries else "itself")


def test_a_function_that_reads_nothing_answers_all_the_same():
    with fork_server(["wave"]):
        assert answer_of("imported_toy:say_hello", "long" * 2**18) == "hello"


def test_questions_are_answered_after_the_server_was_killed():
    others = psutil.Process().children()
    with fork_server(["wave"]):
        assert answer_of("imported_toy:say_hello", "") == "hello"
        for process in set(psutil.Process().children()).difference(others):
            process.kill()
            process.wait()
        assert answer_of("imported_toy:say_hello", "") == "hello"
