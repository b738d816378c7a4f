"""The training of a style network, in one process or, by torchrun, in one a card.

`torchrun -m tasks.network_training ASKED.json` is what each of several runs; the first of them
prints where it stands, a line of JSON a message.
"""

import json
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pipeline.execution.cpu_memory import THREADS, usable_cores
from pipeline.execution.parent_process import die_with
from pipeline.execution.progress_pipe import ProgressPipe, read_messages
from pipeline.job import Display
from styletrf.errors import InputError


@dataclass(frozen=True, slots=True)
class Asked:
    """What is to be trained, as JSON can tell it: paths are words.

    Attributes:
        settings: Of `StyleTrainingConfig`.
        stroke_scale: See `tasks.controls`.
        content_weight: See `tasks.controls`.
        inputs: Folders: style, content, perceptual, and renders where these are looked at.
        out: The folder to fill.
        resume: That of checkpoints.
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


def train(asked: Asked, display: Display) -> None:
    """Trains on as many cards as this build sees, and writes the network and its curve."""
    import torch

    from styletrf.devices import device_named

    is_gpu = device_named(asked.device).type == "cuda"
    cards = processes_for(batch_of(asked.settings), torch.cuda.device_count()) if is_gpu else 1
    if cards > 1:
        train_together(asked, cards, display)
    else:
        train_here(asked, display)


def train_together(asked: Asked, processes: int, display: Display) -> None:
    """Trains in several processes that share each batch; torchrun ends all when one fails.

    Raises:
        InputError: What one of them tells its user.
        RuntimeError: They failed otherwise.
    """
    threads = str(max(1, len(usable_cores()) // processes))
    launch = [sys.executable, "-P", "-m", "torch.distributed.run", "--standalone"]
    command = [*launch, f"--nproc-per-node={processes}", "-m", "tasks.network_training"]
    with tempfile.NamedTemporaryFile("w", suffix=".json") as specification:
        json.dump(asdict(asked), specification)
        specification.flush()
        with subprocess.Popen(
            [*command, specification.name],
            stdout=subprocess.PIPE,
            env={**os.environ, **dict.fromkeys(THREADS, threads)},
        ) as together:
            told = read_messages(together.stdout or [], display)
    if "refused" in told:
        raise InputError(*told["refused"])
    if together.returncode:
        raise RuntimeError(f"torchrun ended with status {together.returncode}")


def train_here(asked: Asked, display: Display) -> None:
    """Trains in this process, which may be one of several."""
    import torch

    from styletrf.configuration import configured
    from styletrf.devices import device_named
    from styletrf.files.images import read_rgb
    from styletrf.files.tables import write_curve
    from styletrf.style.perceptual.vgg import load_vgg
    from styletrf.style.style_network import save_style_network
    from styletrf.style.training.config import StyleTrainingConfig, steered
    from styletrf.style.training.data_parallel import joined
    from styletrf.style.training.trainer import train_style_network
    from styletrf.style.transfer.weights import load_style_transfer

    inputs, device = {n: Path(path) for n, path in asked.inputs.items()}, device_named(asked.device)
    ranks = joined(device)
    if device.type == "cuda":
        torch.cuda.set_device(ranks.rank)
    config = configured(StyleTrainingConfig, asked.settings)
    config, pairs = steered(config, asked.stroke_scale, asked.content_weight), None
    if "renders" in inputs:
        pairs = _pairs_to_train_on(inputs["renders"], config, asked.measured)
    style = torch.from_numpy(read_rgb(inputs["style"] / "style.png"))
    initial = predictor = None
    if config.warm_start:
        transfer = load_style_transfer(inputs["transfer"], device)
        initial, predictor = transfer.network_for(style.to(device)), transfer.predictor
    network, curve = train_style_network(
        config,
        load_vgg(inputs["perceptual"] / "vgg16.safetensors", device),
        style,
        inputs["content"],
        checkpoint_folder=Path(asked.resume),
        initial=initial,
        predictor=predictor,
        pairs=pairs,
        progress=display,
        ranks=ranks,
    )
    if ranks.is_first:
        save_style_network(network, Path(asked.out))
        write_curve(Path(asked.out) / "curve.parquet", curve)


def _pairs_to_train_on(renders: Path, config: Any, measured: Mapping[str, Any]) -> Any:
    """Returns the pairs of renders but for those that ConsistencyMetrics measures."""
    from styletrf.configuration import configured
    from styletrf.evaluation.consistency.frame_pairs import PairPlan, planned_pairs
    from styletrf.files.tables import read_summary
    from styletrf.geometry.camera_table import read_cameras
    from styletrf.style.training.render_pairs import RenderPairs
    from styletrf.trajectory.stills import cuts_of

    n_renders = len(read_cameras(renders / "cameras.parquet"))
    cuts = cuts_of(read_summary(renders / "support.json"))
    planned = planned_pairs(n_renders, configured(PairPlan, measured), cuts)
    return RenderPairs(
        renders,
        batch=config.batch,
        crop_px=config.crop_px,
        seed=config.seed,
        measured={(pair.first, pair.second) for pair in planned},
    )


def batch_of(settings: Mapping[str, Any]) -> int:
    """Returns how many photographs a step of a training with these settings takes."""
    from styletrf.configuration import configured
    from styletrf.style.training.config import StyleTrainingConfig

    return configured(StyleTrainingConfig, settings).batch


def processes_for(batch: int, most: int) -> int:
    """Returns how many processes, of so many at most, can have equal parts of each batch."""
    return max(n for n in range(1, max(most, 1) + 1) if batch % n == 0)


class _Told(logging.Handler):
    """Warnings, to whoever shows how the training goes."""

    def __init__(self, channel: ProgressPipe) -> None:
        super().__init__(logging.WARNING)
        self._channel = channel

    def emit(self, record: logging.LogRecord) -> None:
        """Tell the warning."""
        self._channel.say(f"StyleNetwork: warning: {record.getMessage()}")


def main() -> None:
    """Trains as one of several."""
    die_with(os.getppid())  # torchrun gives its processes sessions of their own
    asked, channel = Asked(**json.loads(Path(sys.argv[1]).read_text())), ProgressPipe(1)
    logging.getLogger().addHandler(_Told(channel))
    try:
        train_here(asked, channel)
    except InputError as error:
        channel.send(refused=[error.subject, error.problem, error.remedy])
        raise


if __name__ == "__main__":
    main()
