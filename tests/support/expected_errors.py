"""Errors that a test expects, by their types and fields, so that messages can improve."""

from contextlib import contextmanager
from pathlib import Path

import pytest
from message_words import mentions

from styletrf.errors import InputError, NotFiniteError


@contextmanager
def rejects(subject, *values, kind=InputError, remedy=()):
    """Expects an error about an input, whose problem has all the values.

    A path is all of the subject. A name is a word of it, as each value is of the problem: values
    tell errors about one input from each other. The remedy has its own words, such as an option.
    """
    with pytest.raises(kind) as caught:
        yield caught
    error = caught.value
    assert type(error) is kind
    if isinstance(subject, Path):
        assert error.subject == str(subject)
    else:
        assert mentions(error.subject, subject)
    assert mentions(error.problem, *values)
    assert error.remedy
    assert mentions(error.remedy, *remedy)


@contextmanager
def stops(stage: str, tensor: str, where: str):
    """Expects a fit whose values are no longer finite to end, and to say which were the first."""
    with pytest.raises(NotFiniteError) as caught:
        yield
    error = caught.value
    assert (error.stage, error.tensor, error.where) == (stage, tensor, where)
