"""A fit resumes exactly from its checkpoint, and does without one of another version."""

import copy
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from mini_scene import MINI_FIT, fit

from styletrf.field.kernels import kernels_for
from styletrf.field.training.checkpoint import FieldCurvePoint, FitState, restore_fit, save_fit
from styletrf.field.training.trainer import FieldTrainer
from styletrf.files.checkpoints import load_checkpoint, save_checkpoint

CPU = torch.device("cpu")
KERNELS = kernels_for(CPU)
SHORT = replace(MINI_FIT, iterations=45, occupancy_every=8)


@pytest.fixture(scope="module")
def whole(scene) -> dict[str, torch.Tensor]:
    """The parameters after a short fit that nothing stopped."""
    return fit(scene, SHORT).state_dict()


@pytest.mark.parametrize("killed_at", [9, 14, 15, 38])
def test_a_killed_run_resumes_to_the_same_parameters(scene, whole, tmp_path: Path, killed_at):
    """Also across an up-sampling step: at 15 the optimizer is new and the grid finer."""
    every_step = replace(SHORT, checkpoint_seconds=0.0)

    def kill(done, total, **quality):
        if done == killed_at:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(scene, every_step, progress=kill, checkpoint_dir=tmp_path)
    resumed = fit(scene, every_step, checkpoint_dir=tmp_path)
    for name, tensor in whole.items():
        assert torch.equal(tensor, resumed.state_dict()[name]), name


def test_a_damaged_checkpoint_counts_as_none(scene, tmp_path: Path):
    (tmp_path / "checkpoint.safetensors").write_bytes(b"garbage")
    config = replace(MINI_FIT, iterations=3)
    whole = fit(scene, config).state_dict()
    for name, tensor in fit(scene, config, checkpoint_dir=tmp_path).state_dict().items():
        assert torch.equal(tensor, whole[name]), name


@pytest.mark.parametrize(
    "change",
    ["a number more", "a number less", "a default less", "another curve", "no fit", "null fit"],
)
def test_a_checkpoint_of_another_version_counts_as_none_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, change: str
):
    """It ended the fit in a traceback."""
    state = FitState(10, 5, 0, curve=[FieldCurvePoint(1, 1.0, 1.0, 1, 1.0, 1.0)])
    fit_numbers = asdict(state)
    if change == "a number more":
        fit_numbers["other"] = 1
    elif change == "a number less":
        del fit_numbers["next_member"]
    elif change == "a default less":
        del fit_numbers["seconds"]
    elif change == "another curve":
        del fit_numbers["curve"][0]["psnr"]
    numbers: dict[str, Any] = {} if change == "no fit" else {"fit": fit_numbers}
    if change == "null fit":
        numbers["fit"] = None
    save_checkpoint(tmp_path, {"field": torch.zeros(1)}, numbers | {"averaged": 0})
    untouched: Any = SimpleNamespace(images=torch.zeros(1))  # all that is needed to load one
    restore_fit(tmp_path, untouched)
    assert [str(tmp_path) in message for message in caplog.messages] == [True]


@pytest.mark.parametrize("change", ["a tensor more", "a tensor less", "no generator"])
def test_a_checkpoint_with_tensors_of_another_version_counts_as_none_with_a_warning(
    scene, tmp_path: Path, caplog: pytest.LogCaptureFixture, change: str
):
    """It ended the fit in a traceback, once the grid had grown and the optimizer was new."""
    trainers = [FieldTrainer(scene.views(), scene.volume, MINI_FIT, KERNELS) for _ in range(2)]
    trainers[0].step()
    save_fit(tmp_path, trainers[0])
    tensors, numbers = load_checkpoint(tmp_path, CPU)
    if change == "a tensor more":
        tensors["field.other"] = torch.zeros(1)
    else:
        del tensors["generator" if change == "no generator" else "field.appearance.background"]
    save_checkpoint(tmp_path, tensors, numbers)
    restored, untouched = trainers[1], copy.deepcopy(trainers[1].state)
    before = (restored.optimizer, restored.average, restored.generator.get_state())
    restore_fit(tmp_path, restored)
    assert [str(tmp_path) in message for message in caplog.messages] == [True]
    assert restored.state == untouched
    assert (restored.optimizer, restored.average) == before[:2]
    assert torch.equal(restored.generator.get_state(), before[2])
