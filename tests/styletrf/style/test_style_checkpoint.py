from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file

from styletrf.style.style_network import StyleNetwork, StyleNetworkConfig
from styletrf.style.training.checkpoint import CurveRow, Training, read_checkpoint, write_checkpoint


def new_training(seed: int = 0) -> Training:
    generator = torch.Generator().manual_seed(seed)
    network = StyleNetwork(StyleNetworkConfig(width=4, n_residual=1), generator)
    return Training(network, torch.optim.Adam(network.parameters()))


def step(training: Training) -> None:
    images = torch.linspace(0, 1, 3 * 16 * 16).reshape(1, 3, 16, 16)
    loss = training.network(images).square().mean()
    training.optimizer.zero_grad()
    loss.backward()
    training.optimizer.step()
    k = len(training.curve) + 1
    training.curve.append(CurveRow(k, float(loss.detach()), 0.1, 0.2, 0.3, 0.4, 0.5, 1.5 * k))


def test_a_restored_training_takes_the_same_steps(tmp_path: Path):
    original, restored = new_training(), new_training(seed=1)
    for _ in range(3):
        step(original)
    write_checkpoint(tmp_path / "c.safetensors", original)
    read_checkpoint(tmp_path / "c.safetensors", restored)
    for _ in range(2):
        step(original)
        step(restored)
    assert original.curve == restored.curve
    assert restored.seconds == 7.5
    for a, b in zip(original.network.parameters(), restored.network.parameters(), strict=True):
        assert torch.equal(a, b)


def test_before_the_first_step_there_is_nothing_to_lose(tmp_path: Path):
    write_checkpoint(tmp_path / "c.safetensors", new_training())
    restored = new_training(seed=1)
    read_checkpoint(tmp_path / "c.safetensors", restored)
    assert (restored.curve, restored.seconds) == ([], 0)
    step(restored)


def test_no_checkpoint_leaves_the_training_as_it_is(tmp_path: Path):
    training = new_training()
    before = [parameter.clone() for parameter in training.network.parameters()]
    read_checkpoint(tmp_path / "absent.safetensors", training)
    after = training.network.parameters()
    assert all(torch.equal(a, b) for a, b in zip(before, after, strict=True))


def test_a_write_that_fails_leaves_the_last_checkpoint(tmp_path: Path, monkeypatch):
    path, training = tmp_path / "c.safetensors", new_training()
    write_checkpoint(path, training)
    before = path.read_bytes()

    def full_disk(tensors: object, partial: Path) -> None:
        partial.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("styletrf.style.training.checkpoint.save_file", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_checkpoint(path, training)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("damage", ["cut short", "no tensor", "another network", "empty"])
def test_a_damaged_checkpoint_lets_the_training_start_over_with_a_warning(
    tmp_path: Path, damage: str, caplog: pytest.LogCaptureFixture
):
    path, stored = tmp_path / "c.safetensors", new_training()
    step(stored)
    write_checkpoint(path, stored)
    tensors = load_file(path)
    last = max(name for name in tensors if name.startswith("network."))
    if damage == "no tensor":
        del tensors[last]
    elif damage == "another network":
        tensors[last] = torch.zeros(7)
    save_file(tensors, path)
    if damage in ("cut short", "empty"):
        path.write_bytes(path.read_bytes()[: -100 if damage == "cut short" else 0])
    training, fresh = new_training(seed=1), new_training(seed=1)
    read_checkpoint(path, training)
    assert [str(path) in message for message in caplog.messages] == [True]
    assert training.curve == []
    assert not training.optimizer.state
    for a, b in zip(training.network.parameters(), fresh.network.parameters(), strict=True):
        assert torch.equal(a, b), "not even half of it was taken over"
