from pathlib import Path

import pytest
import torch
from message_words import mentions

from styletrf.files.checkpoints import load_checkpoint, save_checkpoint
from styletrf.style.style_network import StyleNetwork, StyleNetworkConfig
from styletrf.style.training.checkpoint import (
    StyleCurvePoint,
    Training,
    read_checkpoint,
    write_checkpoint,
)


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
    terms = (0.1, 0.2, 0.3, 0.4, 0.5)
    training.curve.append(StyleCurvePoint(k, float(loss.detach()), *terms, 1.5 * k))


def test_a_restored_training_takes_the_same_steps(tmp_path: Path):
    original, restored = new_training(), new_training(seed=1)
    for _ in range(3):
        step(original)
    write_checkpoint(tmp_path, original)
    read_checkpoint(tmp_path, restored)
    for _ in range(2):
        step(original)
        step(restored)
    assert original.curve == restored.curve
    assert restored.seconds == 7.5
    for a, b in zip(original.network.parameters(), restored.network.parameters(), strict=True):
        assert torch.equal(a, b)


def test_before_the_first_step_there_is_nothing_to_lose(tmp_path: Path):
    write_checkpoint(tmp_path, new_training())
    restored = new_training(seed=1)
    read_checkpoint(tmp_path, restored)
    assert (restored.curve, restored.seconds) == ([], 0)
    step(restored)


def test_no_checkpoint_leaves_the_training_as_it_is(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    assert starts_over(tmp_path)
    assert caplog.messages == []


@pytest.mark.parametrize(
    "damage", ["cut short", "no tensor", "another network", "another curve", "empty"]
)
def test_a_damaged_checkpoint_lets_the_training_start_over_with_a_warning(
    tmp_path: Path, damage: str, caplog: pytest.LogCaptureFixture
):
    stored = new_training()
    step(stored)
    write_checkpoint(tmp_path, stored)
    tensors, state = load_checkpoint(tmp_path, torch.device("cpu"))
    last = max(name for name in tensors if name.startswith("network."))
    if damage == "no tensor":
        del tensors[last]
    elif damage == "another network":
        tensors[last] = torch.zeros(7)
    elif damage == "another curve":
        state["curve"][0].append(1.0)
    save_checkpoint(tmp_path, tensors, state)
    if damage in ("cut short", "empty"):
        (path,) = tmp_path.iterdir()
        path.write_bytes(path.read_bytes()[: -100 if damage == "cut short" else 0])
    assert starts_over(tmp_path)
    assert [str(tmp_path) in message for message in caplog.messages] == [True]


def test_a_checkpoint_of_an_earlier_version_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    path = tmp_path / "style_training.safetensors"
    path.write_bytes(b"tensors")
    assert starts_over(tmp_path)
    (message,) = caplog.messages
    assert mentions(message, path)


def starts_over(folder: Path) -> bool:
    """Whether a training takes nothing over from the folder, not even half of a checkpoint."""
    training, fresh = new_training(seed=1), new_training(seed=1)
    read_checkpoint(folder, training)
    pairs = zip(training.network.parameters(), fresh.network.parameters(), strict=True)
    is_fresh = all(torch.equal(a, b) for a, b in pairs)
    return is_fresh and not training.curve and not training.optimizer.state
