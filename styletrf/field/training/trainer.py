"""The iterations of a fit of a radiance field, coarse to fine (TensoRF section 4).

Rays are made from pixels and never stored. No pixel comes twice before every other had its turn,
in an order that spreads each batch over all views (`styletrf.capture.view_images`). The grid grows
geometrically from `initial_voxels` to the scene's resolution, at the fractions of the iterations in
`upsample_at`. The learning rates restart each time. The occupancy grid is recomputed from the
density regularly. The finished field has the mean of the last parameters
(`styletrf.field.training.parameter_average`).
"""

import copy
import logging
import math
import time
from collections.abc import Iterable
from pathlib import Path

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from styletrf.capture.view_images import view_images
from styletrf.errors import NotFiniteError
from styletrf.field.kernels import Kernels, RaySegments, Samples, Sparsification
from styletrf.field.occupancy import initial_occupancy, occupied_voxels, remaining
from styletrf.field.pixel_rays import pixel_rays
from styletrf.field.radiance_field import RadianceField, set_occupancy
from styletrf.field.rendering import RenderConfig, render_color, render_rays
from styletrf.field.training.background import begin_with_background
from styletrf.field.training.checkpoint import FieldCurvePoint, FitState, restore_fit, save_fit
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.diagnostics import iteration_stages
from styletrf.field.training.distortion import distortion
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.observed_depths import depth_loss
from styletrf.field.training.optimizer import optimizer_of, take_step
from styletrf.field.training.parameter_average import ParameterAverage
from styletrf.field.training.regularization import add_regularization_gradient
from styletrf.field.training.schedule import decay, march_step, stage_resolution
from styletrf.field.training.validation_views import validation_views
from styletrf.field.view_rays import ViewRays
from styletrf.finiteness import Named, first_not_finite, parameter_stages
from styletrf.psnr import bounded_psnr

_LOGGER = logging.getLogger(__name__)
CURVE_EVERY = 50  # iterations between points of the curve
LOSS_RAYS = 1 << 14


class FieldTrainer:
    """The mutable state of one fit, see `styletrf.field.training.field_training`."""

    def __init__(
        self,
        views: TrainingViews,
        volume: FieldVolume,
        config: FieldTrainingConfig,
        kernels: Kernels,
        checkpoint_dir: Path | None = None,
    ) -> None:
        config = config.in_space(volume.space.kind)
        self.config, self.kernels, self.images = config, kernels, view_images(views.images)
        device = self.images.device
        self.checkpoint_dir = checkpoint_dir
        self.validation = validation_views(views.cameras, self.images, config)
        self.cameras, self.exposures = views.cameras, views.exposures
        self.space, self.final_resolution = volume.space, volume.resolution
        self.generator = torch.Generator().manual_seed(config.seed)
        self.field = RadianceField(config.field, self._resolution(0), self.generator).to(device)
        next_member = int(torch.randint(1 << 31, (), generator=self.generator))
        self.state = FitState(config.iterations, config.batch, next_member)
        self.begin_stage()
        self.free = None if volume.free is None else volume.free.to(device)
        self.depths = None if views.depths is None else views.depths.to(device)
        set_occupancy(self.field.density, initial_occupancy(self.free).to(device))
        begin_with_background(self.field, self.rays, self.images, self.generator)
        if checkpoint_dir is not None:
            restore_fit(checkpoint_dir, self)

    def step(self) -> float:
        """Runs one iteration and returns the smoothed PSNR of the training rays."""
        started, state = time.monotonic(), self.state
        self._grow_and_refresh()
        pixels = self._next_pixels()
        segments, target = pixel_rays(self.rays, self.images, pixels)
        samples, color = self._render(segments)
        loss = self._error(color, target, pixels)
        mse = float(loss.detach())
        # a NaN among the weights need not reach the loss
        if not math.isfinite(mse + float(samples.weights.detach().sum())):
            self._require_finite_iteration(segments, samples, color.detach(), loss.detach())
        if self.config.distortion_weight:
            loss = loss + self.config.distortion_weight * distortion(samples, segments)
        loss.backward()
        self._add_depth_gradient()
        add_regularization_gradient(self.field, self.config, state.iteration, len(self.cameras))
        since_growth = state.iteration - state.stage_start
        rate = decay(self.config.rate_decay, since_growth, self.config.iterations)
        take_step(self.optimizer, rate)
        state.iteration += 1
        if self.config.average_share and state.iteration % self.config.average_every == 0:
            self.average.add(self.field)
        self._decide_end()
        keep = 0.98 if state.iteration > 1 else 0.0
        state.smooth_mse = keep * state.smooth_mse + (1 - keep) * mse
        state.seconds += time.monotonic() - started
        if state.iteration % CURVE_EVERY == 0:
            state.curve.append(self._curve_point(samples, len(segments)))
            state.batch = self._batch_of(len(samples.ray) / len(segments))
        return self.psnr()

    def finish(self) -> None:
        """Sets the field to the average of its last parameters, and its occupancy to match."""
        self.average.copy_to(self.field)
        self.refresh_occupancy(settled=True)

    def loss(self, field: RadianceField) -> float:
        """Returns the mean squared error of a field at pixels that are always the same."""
        generator = torch.Generator().manual_seed(self.config.seed)
        return self.loss_at(field, self.images.drawn(LOSS_RAYS, generator))

    @torch.no_grad()
    def loss_at(self, field: RadianceField, pixels: Tensor) -> float:
        """Returns the mean squared error of a field at pixels."""
        rays = ViewRays(
            self.cameras, self.space.within(field.bounds), field.step_length, self.images.device
        )
        config = RenderConfig(self.config.termination, self.config.min_weight)
        segments, target = pixel_rays(rays, self.images, pixels)
        color = render_rays(field, self.kernels, segments, config).color
        loss = self._error(color, target, pixels)
        self.require_finite([("loss of the field", loss)])
        return float(loss)

    def psnr(self) -> float:
        """Returns the smoothed PSNR of the training rays."""
        return bounded_psnr(self.state.smooth_mse)

    def _next_pixels(self) -> Int64[Tensor, " rays"]:
        state, validation = self.state, self.validation
        pixels = self.images.spread(state.next_member, state.batch)
        state.next_member += state.batch
        if validation is not None and state.iteration < validation.after:
            pixels = validation.without(self.images, pixels)
        return pixels

    def _decide_end(self) -> None:
        """Measures the validation views, twice, and moves the end of the fit by their gain."""
        views, state = self.validation, self.state
        if views is None or state.iteration not in (views.before, views.after):
            return
        averaged = copy.deepcopy(self.field)
        self.average.copy_to(averaged)
        psnr = bounded_psnr(self.loss_at(averaged, views.pixels))
        gain, state.validation_psnr = psnr - state.validation_psnr, psnr
        if state.iteration == views.after:
            state.end = views.end_after(gain, self.config)
            gained = "validation views gained %.2f dB: %d of %d iterations"
            _LOGGER.info(gained, gain, state.end, self.config.iterations)

    def _curve_point(self, samples: Samples, rays: int) -> FieldCurvePoint:
        colored = int((samples.weights > self.config.min_weight).sum())
        voxels, counts = math.prod(self.field.resolution), (len(samples.ray), colored)
        means = (count / rays for count in counts)
        done = (self.state.iteration, self.state.seconds)
        return FieldCurvePoint(*done, self.psnr(), voxels, *means)

    def _batch_of(self, samples_a_ray: float) -> int:
        least, wanted = self.config.batch, self.config.batch_samples / max(samples_a_ray, 1.0)
        return min(max(int(wanted), least), 8 * least)

    def _error(self, color: Tensor, target: Tensor, pixels: Tensor) -> Float[Tensor, ""]:
        if self.exposures is not None:
            color = self.exposures.shown(color, self.images.places(pixels)[0], target)
        return (color - target).square().mean()

    def _render(self, segments: RaySegments) -> tuple[Samples, Float[Tensor, "rays 3"]]:
        samples = self._trace(segments)
        color = render_color(
            self.field.appearance, self.kernels, segments, samples, self.config.min_weight,
            sparsification=self._sparsification(self.config.color_threshold),
        )  # fmt: skip
        return samples, color

    def _trace(self, segments: RaySegments) -> Samples:
        jitter = torch.rand(len(segments), generator=self.generator).to(segments.lengths)
        sparsification = self._sparsification(self.config.gradient_threshold)
        march = self.field.density.march(self.config.termination, sparsification)
        return self.kernels.trace(self.field.density.factors, segments, jitter, march)

    def _sparsification(self, threshold: float) -> Sparsification:
        return Sparsification(threshold, float(torch.rand((), generator=self.generator)))

    def _add_depth_gradient(self) -> None:
        """Adds the gradient of some rays that end at a depth."""
        config, depths, iteration = self.config, self.depths, self.state.iteration
        until = config.dense_depth_until if depths and depths.are_dense else config.depth_until
        is_over = iteration >= until * config.iterations
        if not (depths and config.depth_weight) or is_over or iteration % config.depth_every:
            return
        drawn = depths.drawn(config.depth_rays, self.generator)
        segments = self.rays.segments(drawn.view, drawn.pixel)
        loss = depth_loss(self._trace(segments), segments, drawn)
        (config.depth_every * config.depth_weight * loss).backward()

    def _grow_and_refresh(self) -> None:
        iteration, steps = self.state.iteration, self.config.upsample_steps
        if iteration in steps:
            stage = len([step for step in steps if step <= iteration])
            self.field.upsample(self._resolution(stage))
            self.begin_stage()
        if iteration and iteration % self.config.occupancy_every == 0:
            self.refresh_occupancy()

    def _resolution(self, stage: int) -> tuple[int, int, int]:
        initial, stages = self.config.initial_voxels, len(self.config.upsample_at)
        return stage_resolution(self.final_resolution, initial, stage, stages)

    def begin_stage(self) -> None:
        """Sets the step length, a new optimizer and a new average for the present resolution."""
        self.state.stage_start = self.state.iteration
        steps_per_voxel = self.config.steps_in(self.space.kind)
        self.field.step_length = march_step(self.space, self.field.resolution, steps_per_voxel)
        self.rays = ViewRays(self.cameras, self.space, self.field.step_length, self.images.device)
        self.optimizer = optimizer_of(self.field, self.config)
        self.average = ParameterAverage(self.config.average_window)

    def refresh_occupancy(self, *, settled: bool = False) -> None:
        """Recomputes the occupancy grid; stops at NaN, which would count as no density.

        A settled grid does not bring back voxels that rays have skipped: they were not fitted
        since then.
        """
        self.require_finite(parameter_stages(self.field, self.optimizer))
        density, config = self.field.density, self.config
        found = occupied_voxels(
            density, self.kernels, self.field.step_length, config.occupancy_alpha,
            settled=settled, free=self.free,
        )  # fmt: skip
        set_occupancy(density, remaining(found, density.occupancy) if settled else found)

    def _require_finite_iteration(
        self, segments: RaySegments, samples: Samples, color: Tensor, loss: Tensor
    ) -> None:
        """Stops at the first tensor that is not finite, in the order of computation."""
        self.require_finite(parameter_stages(self.field, self.optimizer))
        self.require_finite(iteration_stages(self.field, self.kernels, segments, samples, color))
        self.require_finite([("loss", loss)])

    def require_finite(self, stages: Iterable[Named]) -> None:
        """Saves the state and stops where one of the named tensors is not finite."""
        name = first_not_finite(stages)
        if name is None:
            return
        if self.checkpoint_dir is not None:
            save_fit(self.checkpoint_dir / "not_finite", self)
        raise NotFiniteError("field training", name, f"at iteration {self.state.iteration}")
