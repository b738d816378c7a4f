"""Errors that a test expects, by their types and fields, so that messages can improve."""

import re
from contextlib import contextmanager
from pathlib import Path

import pytest

from styletrf.errors import InputError, NotFiniteError


@contextmanager
def rejects(subject, *values, kind=InputError):
    """Expects an error about an input, whose problem has all the values.

    A path is all of the subject. A name is a word of it, as each value is of the problem: values
    tell errors about one input from each other.
    """
    with pytest.raises(kind) as caught:
        yield caught
    error = caught.value
    assert type(error) is kind
    if isinstance(subject, Path):
        assert error.subject == str(subject)
    else:
        assert _has_word(error.subject, subject)
    for value in values:
        assert _has_word(error.problem, str(value))
    assert error.remedy


@contextmanager
def stops(stage: str, tensor: str, where: str):
    """Expects a fit whose values are no longer finite to end, and to say which were the first."""
    with pytest.raises(NotFiniteError) as caught:
        yield
    error = caught.value
    assert (error.stage, error.tensor, error.where) == (stage, tensor, where)


def _has_word(text: str, word: str) -> bool:
    """Whether a text has a word that is no part of a longer name or number."""
    assert word, "nothing is in any text"
    return bool(re.search(rf"(?<![\w.-]){re.escape(word)}(?![\w-]|\.\w)", text))
