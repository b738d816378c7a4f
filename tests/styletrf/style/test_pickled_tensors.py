"""Files of `torch.save` that cannot be read."""

import pytest
import torch
from expected_errors import rejects

from styletrf.style.pickled_tensors import read_pickled


def failing(monkeypatch, error):
    def load(*_, **__):
        raise error

    monkeypatch.setattr(torch, "load", load)


def test_a_file_that_does_not_fit_into_the_memory_is_not_called_damaged(tmp_path, monkeypatch):
    failing(monkeypatch, MemoryError())
    with pytest.raises(MemoryError):
        read_pickled(tmp_path / "a.pth", "weights", "Save them again")


@pytest.mark.parametrize("error", [ValueError("bad\nat 7"), KeyError("bad"), EOFError()])
def test_an_error_has_the_kind_and_the_first_line_of_its_cause(tmp_path, monkeypatch, error):
    failing(monkeypatch, error)
    words = [type(error).__name__, *("bad" for _ in error.args)]
    with rejects(tmp_path / "a.pth", "weights", *words) as caught:
        read_pickled(tmp_path / "a.pth", "weights", "Save them again")
    assert "\n" not in caught.value.problem
