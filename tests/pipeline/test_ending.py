"""What a process does at its end: in which order, whatever fails, and while S3 can be asked."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def said_at_the_end_of(code: str, **environment: str) -> str:
    process = subprocess.run(
        [sys.executable, "-c", f"from pipeline.ending import at_end\n{code}"],
        capture_output=True, text=True, cwd=ROOT, env=os.environ | environment, timeout=60,
        check=False,
    )  # fmt: skip
    return process.stdout + process.stderr


def test_what_was_asked_first_is_done_last_and_what_was_taken_back_is_not():
    code = """
at_end(lambda: print("first"))
at_end(lambda: print("second"))()
at_end(lambda: print("third"))
"""
    assert said_at_the_end_of(code).split() == ["third", "first"]


def test_what_fails_at_the_end_is_told_and_keeps_nothing_else_from_being_done():
    said = said_at_the_end_of('at_end(lambda: print("done"))\nat_end(lambda: 1 / 0)')
    assert "ZeroDivisionError" in said
    assert "done" in said


def test_a_process_forked_off_does_none_of_it():
    code = """
import multiprocessing
at_end(lambda: print("done", flush=True))
child = multiprocessing.get_context("fork").Process(target=print, args=("child",))
child.start()
child.join()
"""
    assert said_at_the_end_of(code).split() == ["child", "done"]


def test_asked_in_a_process_that_was_forked_off_it_does_nothing():
    code = """
import multiprocessing
child = multiprocessing.get_context("fork").Process(target=at_end, args=(lambda: print("done"),))
child.start()
child.join()
"""
    assert said_at_the_end_of(code) == ""


def test_what_is_interrupted_at_the_end_is_told():
    code = """
def interrupt():
    raise KeyboardInterrupt
at_end(lambda: print("done"))
at_end(interrupt)
"""
    said = said_at_the_end_of(code)
    assert "KeyboardInterrupt" in said
    assert "done" in said


def test_a_bucket_can_be_asked_at_the_end_by_who_never_asked_before(server):
    """A command that ends early looks at its end for what others have made."""
    code = f"""
from pipeline.remote import open_remote
at_end(lambda: print("found", open_remote("{server.bucket().url}").read("nothing")))
"""
    assert said_at_the_end_of(code, **server.environment()).strip() == "found None"
