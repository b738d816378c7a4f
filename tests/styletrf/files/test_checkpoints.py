from pathlib import Path

import pytest
import torch

from styletrf.files.checkpoints import load_checkpoint, save_checkpoint

CPU = torch.device("cpu")


def test_what_is_saved_is_loaded(tmp_path: Path):
    save_checkpoint(tmp_path, {"a": torch.arange(3.0)}, {"iteration": 7})
    tensors, state = load_checkpoint(tmp_path, CPU)
    assert torch.equal(tensors["a"], torch.arange(3.0))
    assert state == {"iteration": 7}


def test_without_a_checkpoint_nothing_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    assert load_checkpoint(tmp_path, CPU) is None
    assert caplog.messages == []


def test_a_checkpoint_that_cannot_be_read_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    """A fit began from nothing, and nobody knew why."""
    save_checkpoint(tmp_path, {"a": torch.arange(3.0)}, {"iteration": 7})
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:20])
    assert load_checkpoint(tmp_path, CPU) is None
    (message,) = caplog.messages
    assert str(path) in message


def test_a_write_that_fails_leaves_the_last_checkpoint(tmp_path: Path, monkeypatch):
    def full_disk(_: object, partial: Path, **_metadata: object) -> None:
        partial.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    save_checkpoint(tmp_path, {"a": torch.arange(3.0)}, {"iteration": 7})
    (path,) = tmp_path.iterdir()
    before = path.read_bytes()
    monkeypatch.setattr("styletrf.files.checkpoints.save_file", full_disk)
    with pytest.raises(OSError, match="No space"):
        save_checkpoint(tmp_path, {"a": torch.arange(4.0)}, {"iteration": 8})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
