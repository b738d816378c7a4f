"""Training of a style network in one process, or by torchrun in one process per GPU.

Each process runs `python -m tasks.stages.training_rank REQUEST.json`.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pipeline.execution.cpu_memory import THREADS, usable_cores
from pipeline.execution.progress_pipe import read_messages
from pipeline.job import Display
from styletrf.errors import InputError
from styletrf.steps.step_run import StepRun


@dataclass(frozen=True, slots=True)
class TrainingRequest:
    """The request for a training, in types that JSON has: paths are strings.

    Attributes:
        settings: Those of `StyleTrainingConfig`.
        stroke_scale: See `tasks.stages.style_parameters`.
        content_weight: See `tasks.stages.style_parameters`.
        inputs: The folders: style, content, perceptual, and renders where the training uses these.
        out: The folder to fill.
        resume: The folder of checkpoints.
        device: `auto`, `cpu` or `cuda`.
        measured: The settings that decide which pairs of renders are measured, and kept out.
    """

    settings: Mapping[str, Any]
    stroke_scale: float
    content_weight: float
    inputs: Mapping[str, str]
    out: str
    resume: str
    device: str
    measured: Mapping[str, Any] = field(default_factory=dict)


def train(request: TrainingRequest, display: Display) -> None:
    """Trains on all GPUs visible to this build, and writes the network and its curve."""
    import torch

    from styletrf.devices import device_named

    is_gpu = device_named(request.device).type == "cuda"
    gpus = processes_for(batch_of(request.settings), torch.cuda.device_count()) if is_gpu else 1
    if gpus > 1:
        train_distributed(request, gpus, display)
    else:
        train_local(request, display)


def train_distributed(request: TrainingRequest, processes: int, display: Display) -> None:
    """Trains in several processes that share each batch; if one fails, torchrun ends all.

    Raises:
        InputError: A process rejected its input.
        RuntimeError: A process failed otherwise.
    """
    threads = str(max(1, len(usable_cores()) // processes))
    launch = [sys.executable, "-P", "-m", "torch.distributed.run", "--standalone"]
    command = [*launch, f"--nproc-per-node={processes}", "-m", "tasks.stages.training_rank"]
    with tempfile.NamedTemporaryFile("w", suffix=".json") as specification:
        json.dump(asdict(request), specification)
        specification.flush()
        with subprocess.Popen(
            [*command, specification.name],
            stdout=subprocess.PIPE,
            env={**os.environ, **dict.fromkeys(THREADS, threads)},
        ) as together:
            messages = read_messages(together.stdout or [], display)
    if "refused" in messages:
        raise InputError(*messages["refused"])
    if together.returncode:
        raise RuntimeError(f"torchrun ended with status {together.returncode}")


def train_local(request: TrainingRequest, display: Display) -> None:
    """Trains in this process, which may be one of several ranks."""
    from styletrf.steps.style_network import train_network

    train_network(
        {name: Path(path) for name, path in request.inputs.items()},
        Path(request.out),
        request.settings,
        StepRun(Path(request.resume), request.device, display),
        factors=(request.stroke_scale, request.content_weight),
        measured=request.measured,
    )


def batch_of(settings: Mapping[str, Any]) -> int:
    """Returns the batch size of a training with these settings."""
    from styletrf.configuration import configured
    from styletrf.style.training.config import StyleTrainingConfig

    return configured(StyleTrainingConfig, settings).batch


def processes_for(batch: int, most: int) -> int:
    """Returns the largest number of processes, at most `most`, that divides the batch."""
    return max(n for n in range(1, max(most, 1) + 1) if batch % n == 0)
