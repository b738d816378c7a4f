"""Reference workloads, one for each kind of stage: poses, field and style network.

Each is a fixed piece of what its stages compute for minutes, on images drawn from a seed. The
ratio of its seconds on two machines is the ratio that the stages of its kind are assumed to have.
All workloads take a few seconds; kernels that were never compiled here add up to a minute, once.
"""

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import psutil
import torch

from styletrf.colmap import pycolmap
from styletrf.field.field_config import FieldConfig
from styletrf.field.kernels import kernels_for
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.trainer import FieldTrainer
from styletrf.files.images import write_rgb
from styletrf.free_cores import FreeCoreThreads
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.style.perceptual.vgg import VGG16
from styletrf.style.training.checkpoint import new_training
from styletrf.style.training.config import StyleTrainingConfig
from styletrf.style.training.step import StyleStep
from styletrf.style.transfer.network import TransferNetwork, TransferNetworkConfig

_REPEATS = 3
_PERIOD_S = 0.1
_SIDE_PX = 640
_LATTICE = 96
_FIELD_STEPS = 8
_NETWORK_STEPS = 4
_CROP_PX = 160


def measure_workloads(device: torch.device) -> dict[str, float]:
    """Returns the seconds of each workload, by the kind of stages: `poses`, `field`, `network`.

    Of three runs the fastest counts, which other work disturbed least.

    Args:
        device: Where stages compute; poses are always solved on the CPU.
    """
    return {
        "poses": fastest_of(_extraction),
        "field": fastest_of(field_steps(device)),
        "network": fastest_of(network_steps(device)),
    }


def fastest_of(workload: Callable[[], None], repeats: int = _REPEATS) -> float:
    """Returns the seconds of the fastest run, after one that is not counted.

    The threads are as many as cores that other work left free in the run before. The fraction of
    the cores that other work took meanwhile is subtracted.
    """
    threads, seconds = FreeCoreThreads(period_s=_PERIOD_S), []
    workload()
    for _ in range(repeats):
        threads.adjust()
        seconds.append(_undisturbed_s(workload))
    return min(seconds)


def _undisturbed_s(workload: Callable[[], None]) -> float:
    """Returns the seconds of a run, as they would be without other work: at least its CPU time."""
    cores = os.cpu_count() or 1
    started, own, busy = time.perf_counter(), time.process_time(), _busy_s()
    workload()
    elapsed_s = time.perf_counter() - started
    own_s, busy_s = time.process_time() - own, _busy_s() - busy
    return max(elapsed_s - max(busy_s - own_s, 0.0) / cores, own_s / cores)


def _busy_s() -> float:
    """Returns for how long all cores together have worked since the machine started."""
    times = psutil.cpu_times()
    return float(times.user + times.system + getattr(times, "nice", 0.0))


def _picture(side_px: int) -> np.ndarray:
    """Returns an RGB image with detail at several scales: (side, side, 3) in [0, 255]."""
    rng = np.random.default_rng(0)
    total = np.zeros((side_px, side_px, 3), dtype=np.float32)
    for cells in (8, 32, 128):
        coarse = rng.random((cells, cells, 3), dtype=np.float32)
        total += cv2.resize(coarse, (side_px, side_px), interpolation=cv2.INTER_CUBIC)
    return (255 * np.clip(total / 3, 0, 1)).astype(np.uint8)


def _extraction() -> None:
    """Has COLMAP find the SIFT features of two images.

    Stages use OpenCV's. The workload stays, so that earlier calibrations remain comparable.
    """
    options = pycolmap.FeatureExtractionOptions(use_gpu=False)
    options.sift.max_num_features, options.sift.first_octave = 4096, 0
    picture = _picture(_SIDE_PX).astype(np.float32) / 255
    with tempfile.TemporaryDirectory() as folder:
        for name in ("0.png", "1.png"):
            write_rgb(Path(folder) / name, picture)
        pycolmap.extract_features(
            Path(folder) / "features.db",
            Path(folder),
            extraction_options=options,
            device=pycolmap.Device.cpu,
        )


def field_steps(device: torch.device) -> Callable[[], None]:
    """Returns a function that runs some iterations of a fit at its final size."""
    trainer = field_trainer(device)

    def steps() -> None:
        for _ in range(_FIELD_STEPS):
            trainer.step()
        _finish(device)

    return steps


def field_trainer(device: torch.device) -> FieldTrainer:
    """Returns a fit of two images at its final size."""
    pose = np.column_stack([np.eye(3), [0.0, 0.0, -3.0]])
    camera = Camera("0", _SIDE_PX, _SIDE_PX, 500.0, 500.0, _SIDE_PX / 2, _SIDE_PX / 2, pose)
    cameras = [camera, replace(camera, name="1")]
    image = torch.from_numpy(_picture(_SIDE_PX)).to(device)
    config = FieldTrainingConfig(
        field=FieldConfig(density_ranks=(16,), appearance_ranks=(24,), hidden=64),
        upsample_at=(),
        initial_voxels=_LATTICE**3,
        occupancy_every=1 << 30,
        iterations=1 << 20,
    )
    space = Space("box", np.eye(4)[None], (1.0, 1.0, 1.0), depth_min=0.1)
    volume = FieldVolume(space, (_LATTICE, _LATTICE, _LATTICE))
    views = TrainingViews(cameras, [image, image])
    return FieldTrainer(views, volume, config, kernels_for(device))


def network_steps(device: torch.device, images: int = 1) -> Callable[[], None]:
    """Returns a function that runs some iterations of a style training on random weights.

    Args:
        device: Where it trains.
        images: The number of images of a batch, which cores share.
    """
    config = StyleTrainingConfig(
        batch=images, crop_px=_CROP_PX, style_px=_CROP_PX, predictor_weight=0.0, color_weight=0.0
    )
    painting = torch.from_numpy(_picture(_CROP_PX).astype(np.float32) / 255)
    network = TransferNetwork(TransferNetworkConfig(), torch.Generator().manual_seed(0))
    training = new_training(network.to(device))
    with torch.random.fork_rng(devices=[]):  # these layers take no generator
        torch.manual_seed(0)
        vgg = VGG16().to(device)
    step = StyleStep(config, vgg, painting)
    content = painting.movedim(2, 0)[None].repeat(images, 1, 1, 1)

    def steps() -> None:
        for k in range(_NETWORK_STEPS):
            step(training, k, content)
        _finish(device)

    return steps


def _finish(device: torch.device) -> None:
    if device.type == "cuda":
        torch.cuda.synchronize(device)
