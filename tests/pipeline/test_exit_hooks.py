"""Exit hooks: their order, their failures, forked processes, and requests to S3."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def output_of(code: str, **environment: str) -> str:
    process = subprocess.run(
        [sys.executable, "-c", f"from pipeline.exit_hooks import register_exit_hook\n{code}"],
        capture_output=True, text=True, cwd=ROOT, env=os.environ | environment, timeout=60,
        check=False,
    )  # fmt: skip
    return process.stdout + process.stderr


def test_hooks_run_in_reverse_order_except_canceled_ones():
    code = """
register_exit_hook(lambda: print("first"))
register_exit_hook(lambda: print("second"))()
register_exit_hook(lambda: print("third"))
"""
    assert output_of(code).split() == ["third", "first"]


def test_a_hook_that_fails_is_reported_and_the_others_run():
    text = output_of('register_exit_hook(lambda: print("done"))\nregister_exit_hook(lambda: 1 / 0)')
    assert "ZeroDivisionError" in text
    assert "done" in text


def test_a_forked_process_runs_no_hooks():
    code = """
import multiprocessing
register_exit_hook(lambda: print("done", flush=True))
child = multiprocessing.get_context("fork").Process(target=print, args=("child",))
child.start()
child.join()
"""
    assert output_of(code).split() == ["child", "done"]


def test_a_hook_registered_in_a_forked_process_does_not_run():
    code = """
import multiprocessing
act = lambda: register_exit_hook(lambda: print("done"))
child = multiprocessing.get_context("fork").Process(target=act)
child.start()
child.join()
"""
    assert output_of(code) == ""


def test_a_hook_that_is_interrupted_is_reported_and_the_others_run():
    code = """
def interrupt():
    raise KeyboardInterrupt
register_exit_hook(lambda: print("done"))
register_exit_hook(interrupt)
"""
    text = output_of(code)
    assert "KeyboardInterrupt" in text
    assert "done" in text


def test_a_hook_can_send_the_first_request_to_a_bucket(server):
    """A command that ends early fetches the results of other machines in a hook."""
    code = f"""
from pipeline.shared_store.remote import open_remote
register_exit_hook(lambda: print("found", open_remote("{server.bucket().url}").read("nothing")))
"""
    assert output_of(code, **server.environment()).strip() == "found None"
