"""The checks of a command by the libraries of its stages, in the process of the test."""

import io
import sys
from contextlib import redirect_stdout

import pytest

from tasks.planning import request_validation, validation


def check_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the process that a command starts for them: a test with many needs none."""

    def output_of(function: str, text: str) -> str:
        assert function == "tasks.planning.request_validation:main"
        monkeypatch.setattr(sys, "stdin", io.StringIO(text))
        with redirect_stdout(io.StringIO()) as answer:
            assert request_validation.main() == 0
        return answer.getvalue()

    monkeypatch.setattr(validation, "output_of", output_of)
