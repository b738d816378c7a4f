"""Fitting a radiance field to photographs (TensoRF section 4): coarse to fine, in minutes.

Rays are drawn from (view, pixel) and never stored. The grid grows geometrically from `initial` to
the scene's resolution at the steps in `upsample_at`, the learning rates restart there, and the
occupancy grid is refreshed from the density all along.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from styletrf.cameras import Camera
from styletrf.checkpoints import (
    load_checkpoint,
    optimizer_tensors,
    restore_optimizer,
    save_checkpoint,
)
from styletrf.errors import NotFiniteError
from styletrf.field import FieldConfig, RadianceField, set_occupancy
from styletrf.kernels import Kernels, Samples, Segments
from styletrf.occupancy import occupied_voxels
from styletrf.progress import Progress, silent
from styletrf.rendering import render_color
from styletrf.space import Space, ViewRays


@dataclass(frozen=True, slots=True)
class FieldTrainingConfig:
    """How a field is fitted; names in brackets are TensoRF's."""

    field: FieldConfig = field(default_factory=FieldConfig)
    iterations: int = 3000  # [n_iters]
    batch: int = 1536  # rays an iteration [batch_size]
    initial_voxels: int = 80**3  # [N_voxel_init]
    upsample_at: tuple[int, ...] = (200, 400, 700, 1000)  # [upsamp_list]
    steps_per_voxel: float = 0.7  # samples along a ray per lattice point on its longest axis
    factor_rate: float = 0.05  # [lr_init]
    network_rate: float = 3e-3  # [lr_basis]
    rate_decay: float = 0.1  # over all iterations [lr_decay_target_ratio]
    l1_weight: float = 2e-5  # on density factors [L1_weight_inital]
    tv_density: float = 0.01  # [TV_weight_density]
    tv_appearance: float = 0.003  # [TV_weight_app]
    tv_every: int = 4  # iterations between total-variation steps, weighted up to match
    occupancy_every: int = 200
    occupancy_alpha: float = 5e-3  # opacity of one step that counts as occupied [alpha_mask_thre]
    min_weight: float = 3e-3  # samples lighter than this get no colour [rm_weight_mask_thre]
    termination: float = 1e-4
    checkpoint_seconds: float = 60.0
    seed: int = 0


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """One row of the training curve."""

    iteration: int
    seconds: float
    psnr: float
    voxels: int
    density_samples: float  # a ray
    color_samples: float  # a ray


def train_field(
    cameras: Sequence[Camera],
    images: UInt8[Tensor, "views height width 3"],
    space: Space,
    resolution: tuple[int, int, int],
    config: FieldTrainingConfig,
    kernels: Kernels,
    progress: Progress = silent,
    checkpoint_dir: Path | None = None,
) -> tuple[RadianceField, list[CurvePoint]]:
    """Returns the field fitted to the images, and its training curve.

    With a `checkpoint_dir`, the state is saved there about once a minute and a later call
    with the same arguments goes on from it, to the same parameters up to the rounding of sums.

    Raises:
        NotFiniteError: The loss stopped being finite.
    """
    trainer = _Trainer(cameras, images, space, resolution, config, kernels)
    if checkpoint_dir is not None:
        trainer.restore(checkpoint_dir)
    saved = time.monotonic()
    while trainer.iteration < config.iterations:
        psnr = trainer.step()
        if checkpoint_dir is not None and time.monotonic() - saved > config.checkpoint_seconds:
            trainer.save(checkpoint_dir)
            saved = time.monotonic()
        progress(trainer.iteration, config.iterations, psnr=psnr)
    trainer.refresh_occupancy()
    return trainer.field, trainer.curve


_COUNTERS = ("iteration", "seconds", "smooth_mse", "stage_start")


class _Trainer:
    """The mutable state of one fit."""

    def __init__(
        self,
        cameras: Sequence[Camera],
        images: Tensor,
        space: Space,
        resolution: tuple[int, int, int],
        config: FieldTrainingConfig,
        kernels: Kernels,
    ) -> None:
        self.config, self.kernels, self.images = config, kernels, images
        self.cameras, self.space, self.final_resolution = cameras, space, resolution
        self.generator = torch.Generator().manual_seed(config.seed)
        coarse = coarse_resolution(resolution, config, stage=0)
        self.field = RadianceField(config.field, coarse, self.generator).to(images.device)
        self.iteration, self.seconds, self.smooth_mse = 0, 0.0, 0.0
        self.curve: list[CurvePoint] = []
        self._begin_stage()

    def step(self) -> float:
        """Runs one iteration and returns the smoothed PSNR of the training rays."""
        started = time.monotonic()
        self._grow_and_refresh()
        segments, target = self._draw()
        samples, heavy_fraction, loss = self._loss(segments, target)
        mse = float(loss.detach())
        if not math.isfinite(mse):
            raise NotFiniteError("field training", "loss", f"iteration {self.iteration}")
        self._regularized(loss).backward()
        self._set_rates()
        self.optimizer.step()
        self.optimizer.zero_grad()
        self.iteration += 1
        keep = 0.98 if self.iteration > 1 else 0.0
        self.smooth_mse = keep * self.smooth_mse + (1 - keep) * mse
        self.seconds += time.monotonic() - started
        psnr = -10 * math.log10(max(self.smooth_mse, 1e-10))
        if self.iteration % 50 == 0:
            density_samples = len(samples.ray) / self.config.batch
            self.curve.append(
                CurvePoint(
                    self.iteration, self.seconds, psnr, math.prod(self.field.resolution),
                    density_samples, density_samples * heavy_fraction,
                )
            )  # fmt: skip
        return psnr

    def _draw(self) -> tuple[Segments, Float[Tensor, "rays 3"]]:
        n_views, height, width = self.images.shape[:3]
        draw = torch.randint(
            n_views * height * width, (self.config.batch,), generator=self.generator
        ).to(self.images.device)
        view, pixel = draw // (height * width), draw % (height * width)
        row, column = pixel // width, pixel % width
        centers = torch.stack([column, row], dim=-1).double() + 0.5
        target = self.images[view, row, column].float() / 255
        return self.rays.segments(view, centers), target

    def _loss(
        self, segments: Segments, target: Float[Tensor, "rays 3"]
    ) -> tuple[Samples, float, Float[Tensor, ""]]:
        jitter = torch.rand(len(segments), generator=self.generator).to(target)
        march = self.field.density.march(self.config.termination)
        samples = self.kernels.trace(self.field.density.factors, segments, jitter, march)
        color = render_color(
            self.field.appearance, self.kernels, segments, samples, self.config.min_weight
        )
        heavy = float((samples.weights > self.config.min_weight).float().mean())
        return samples, heavy, (color - target).square().mean()

    def _regularized(self, loss: Float[Tensor, ""]) -> Float[Tensor, ""]:
        config, every = self.config, self.config.tv_every
        if self.iteration % every:
            return loss
        decay = self._decay()
        density, appearance = self.field.density.factors, self.field.appearance.factors
        loss = loss + every * config.l1_weight * density.l1()
        loss = loss + every * decay * config.tv_density * density.total_variation()
        return loss + every * decay * config.tv_appearance * appearance.total_variation()

    def _decay(self) -> float:
        return float(self.config.rate_decay ** (self.iteration / self.config.iterations))

    def _set_rates(self) -> None:
        since_growth = self.config.rate_decay ** (
            (self.iteration - self.stage_start) / self.config.iterations
        )
        for group in self.optimizer.param_groups:
            group["lr"] = group["initial_rate"] * since_growth

    def _grow_and_refresh(self) -> None:
        if self.iteration in self.config.upsample_at:
            stage = self.config.upsample_at.index(self.iteration) + 1
            self.field.upsample(coarse_resolution(self.final_resolution, self.config, stage))
            self._begin_stage()
        if self.iteration and self.iteration % self.config.occupancy_every == 0:
            self.refresh_occupancy()

    def _begin_stage(self) -> None:
        """Sets the step and a fresh optimiser for the present resolution."""
        config, self.stage_start = self.config, self.iteration
        self.field.step_length = march_step(
            self.space, self.field.resolution, config.steps_per_voxel
        )
        self.rays = ViewRays(self.cameras, self.space, self.field.step_length, self.images.device)
        field = self.field
        factors = [*field.density.factors.parameters(), *field.appearance.factors.parameters()]
        groups = [
            {"params": factors, "initial_rate": config.factor_rate},
            {"params": field.appearance.network_parameters(), "initial_rate": config.network_rate},
        ]
        self.optimizer = torch.optim.Adam(groups, lr=0.0, betas=(0.9, 0.99), fused=True)

    def refresh_occupancy(self) -> None:
        """Looks again where the density is."""
        density = self.field.density
        set_occupancy(
            density,
            occupied_voxels(
                density, self.kernels, self.field.step_length, self.config.occupancy_alpha
            ),
        )

    def save(self, folder: Path) -> None:
        """Writes a checkpoint."""
        tensors = {f"field.{name}": value for name, value in self.field.state_dict().items()}
        tensors |= optimizer_tensors(self.optimizer)
        tensors["generator"] = self.generator.get_state()
        state = {name: getattr(self, name) for name in _COUNTERS}
        curve = [asdict(point) for point in self.curve]
        save_checkpoint(folder, tensors, {**state, "curve": curve})

    def restore(self, folder: Path) -> None:
        """Goes on from the checkpoint in `folder`, if there is one."""
        checkpoint = load_checkpoint(folder, self.images.device)
        if checkpoint is None:
            return
        tensors, state = checkpoint
        self.iteration = state["stage_start"]
        self.field.upsample(
            [tensors[f"field.density.factors.lines.{k}"].shape[0] for k in (2, 1, 0)]
        )
        self._begin_stage()
        field = {k.removeprefix("field."): v for k, v in tensors.items() if k.startswith("field.")}
        set_occupancy(self.field.density, field["density.occupancy"])
        self.field.load_state_dict(field)
        restore_optimizer(self.optimizer, tensors)
        self.generator.set_state(tensors["generator"].cpu())
        for name in _COUNTERS:
            setattr(self, name, state[name])
        self.curve = [CurvePoint(**point) for point in state["curve"]]


def coarse_resolution(
    final: Sequence[int], config: FieldTrainingConfig, stage: int
) -> tuple[int, int, int]:
    """Returns the resolution of a stage, between `initial_voxels` and `final` geometrically."""
    share = stage / len(config.upsample_at) if config.upsample_at else 1.0
    ratio = min(1.0, config.initial_voxels / math.prod(final)) ** ((1 - share) / 3)
    x, y, z = (max(2, round(n * ratio)) for n in final)
    return x, y, z


def march_step(space: Space, resolution: Sequence[int], steps_per_voxel: float) -> float:
    """Returns the optical length of a step: `steps_per_voxel` steps to the mean voxel side."""
    sides = [2 * length / (n - 1) for length, n in zip(space.axis_lengths, resolution, strict=True)]
    return float(math.prod(sides) ** (1 / 3)) / steps_per_voxel
