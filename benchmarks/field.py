"""What the radiance field costs and shows, from given poses: `python benchmarks/field.py --help`.

Scenes lie below `STYLETRF_DATA`; a row of JSON is printed a measurement. Seconds and milliseconds
are those of training alone, the clock stands while held-out views are rendered.

    field.py train horns --at 200 900 --set training.iterations=12000 training.field.hidden=64
    field.py sweep horns training.min_weight 0.001 0.003 0.01
    field.py frame horns --field FOLDER
    field.py compare horns --iterations 20
"""

import argparse
import json
import resource
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import build_environment  # noqa: F401
import numpy as np
import torch
from given_scenes import GivenScene, load_given_scene

from styletrf.configuration import configured
from styletrf.evaluation.metrics import psnr
from styletrf.field.compression import compress
from styletrf.field.kernels import kernels_for
from styletrf.field.radiance_field import RadianceField, load_field, save_field
from styletrf.field.rendering import RenderConfig
from styletrf.field.training.config import FieldTrainingConfig
from styletrf.field.training.fit_inputs import FieldVolume, TrainingViews
from styletrf.field.training.trainer import FieldTrainer
from styletrf.files.images import from_integers, write_rgb
from styletrf.geometry.cameras import resized
from styletrf.scene.scene_model import SceneModelConfig
from styletrf.trajectory.frames import rendered
from tasks.presets.presets import PRESETS, settings_for

EXHAUSTIVE = RenderConfig(termination=1e-4, min_weight=0.0)


@dataclass(frozen=True)
class Settings:
    """Of the scene's model, the fit, and the frames it is judged by."""

    model: SceneModelConfig = field(default_factory=SceneModelConfig)
    training: FieldTrainingConfig = field(default_factory=FieldTrainingConfig)
    render: RenderConfig = field(default_factory=lambda: RenderConfig(1e-3, 1e-3))


def trainer_of(scene: GivenScene, settings: Settings, kernels: str | None) -> FieldTrainer:
    """Returns a fit that has not begun."""
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    images = [image.to(device) for image in scene.train.images]
    return FieldTrainer(
        TrainingViews(scene.train.cameras, images, scene.depths),
        FieldVolume(scene.model.space, scene.model.resolution, scene.free),
        settings.training,
        kernels_for(device, kernels),
    )


def measurements(
    scene: GivenScene, settings: Settings, kernels: str | None, at: list[float],
    folder: Path | None = None,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Yields what a fit has reached after each of the given seconds and at its end."""
    trainer = trainer_of(scene, settings, kernels)
    trainer.step()  # compiles
    started, before, waiting = time.process_time(), 0.0, sorted(at)
    while trainer.state.iteration < trainer.state.end:
        trainer.step()
        at_end = trainer.state.iteration == trainer.state.end
        if at_end:
            trainer.finish()
        if trainer.state.curve and (at_end or (waiting and trainer.state.seconds >= waiting[0])):
            waiting = [seconds for seconds in waiting if seconds > trainer.state.seconds]
            before += time.process_time() - started
            cpu = {
                "cpu_seconds": before,
                "cpu_ms_per_iteration": 1e3 * before / (trainer.state.iteration - 1),
            }
            yield _reached(trainer) | cpu | held_out(scene, trainer, settings)
            started = time.process_time()
    if settings.training.shrink_rise > 0:
        compression = compress(trainer.field, trainer.loss, settings.training.shrink_rise)
        yield {"shrunk": asdict(compression)} | held_out(scene, trainer, settings)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        save_field(folder, trainer.field)


def _reached(trainer: FieldTrainer) -> dict[str, Any]:
    recent = trainer.state.curve[-min(10, len(trainer.state.curve)) :]
    spent = recent[-1].seconds - recent[0].seconds
    bytes_of_field = sum(t.nbytes for t in trainer.field.state_dict().values())
    return {
        "iteration": trainer.state.iteration,
        "seconds": trainer.state.seconds,
        "ms_per_iteration": 1e3 * spent / max(1, recent[-1].iteration - recent[0].iteration),
        "density_samples": recent[-1].density_samples,
        "color_samples": recent[-1].color_samples,
        "resolution": trainer.field.resolution,
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "model_mb": bytes_of_field / 2**20,
    }


def held_out(scene: GivenScene, trainer: FieldTrainer, settings: Settings) -> dict[str, float]:
    """Returns the mean PSNR of all held-out views."""
    values = [
        psnr(color, from_integers(photograph.numpy()))
        for color, photograph in zip(
            colors(scene, trainer.field, settings.render), scene.test.images, strict=True
        )
    ]
    return {"psnr": float(np.mean(values)), "views": len(values)}


def colors(
    scene: GivenScene, radiance: RadianceField, config: RenderConfig, views: slice = slice(None)
) -> Iterator[np.ndarray]:
    """Yields the renders of held-out views."""
    device = radiance.appearance.background.device
    cameras = scene.test.cameras[views]
    for render in rendered(radiance, scene.model.space, cameras, config, device):
        yield render.color.numpy()


def train(options: argparse.Namespace) -> None:
    """Prints what a fit reaches, and with `--field` keeps it there with its first render."""
    settings = settings_of(options)
    scene = load_given_scene(options.scene, settings.model)
    for row in measurements(scene, settings, options.kernels, options.at, options.field):
        print_row(options, row)
    if options.field is not None:
        first = next(colors(scene, load_field(options.field), settings.render, slice(1)))
        pair = [first, from_integers(scene.test.images[0].numpy())]
        write_rgb(options.field / "first_held_out_view.png", np.concatenate(pair, axis=1))


def sweep(options: argparse.Namespace) -> None:
    """Prints what a fit reaches at each value of one knob."""
    for value in options.values:
        options.set = [*options.set[: options.given], f"{options.knob}={value}"]
        settings = settings_of(options)
        scene = load_given_scene(options.scene, settings.model)
        for row in measurements(scene, settings, options.kernels, []):
            print_row(options, {options.knob: json.loads(value)} | row)


def frame(options: argparse.Namespace) -> None:
    """Prints the best seconds of a frame, and its PSNR to the photograph and the exhaustive one."""
    settings = settings_of(options)
    scene = load_given_scene(options.scene, settings.model)
    if options.long_side:
        scene = _larger(scene, options.long_side)
    radiance = load_field(options.field)
    exhaustive = next(colors(scene, radiance, EXHAUSTIVE, slice(1)))
    print_row(options, frame_row(scene, radiance, exhaustive, settings.render, options.repeats))


def frame_row(
    scene: GivenScene, radiance: RadianceField, exhaustive: np.ndarray, render: RenderConfig,
    repeats: int,
) -> dict[str, Any]:  # fmt: skip
    """Returns what the first held-out view costs at best, and how near it is to the truth."""
    shown, seconds, cpu = exhaustive, [], []
    for _ in range(repeats):
        started, cpu_started = time.monotonic(), time.process_time()
        shown = next(colors(scene, radiance, render, slice(1)))
        seconds.append(time.monotonic() - started)
        cpu.append(time.process_time() - cpu_started)
    row = {
        "seconds": min(seconds),
        "cpu_seconds": min(cpu),
        "psnr_to_exhaustive": psnr(shown, exhaustive),
        "pixels": shown.shape[:2],
    }
    photograph = from_integers(scene.test.images[0].numpy())
    if shown.shape == photograph.shape:
        row |= {"psnr": psnr(shown, photograph), "psnr_exhaustive": psnr(exhaustive, photograph)}
    return row


def _larger(scene: GivenScene, long_side: int) -> GivenScene:
    cameras = [
        resized(c, *(round(n * long_side / max(c.width, c.height)) for n in (c.width, c.height)))
        for c in scene.test.cameras
    ]
    return replace(scene, test=replace(scene.test, cameras=cameras))


def compare(options: argparse.Namespace) -> None:
    """Prints milliseconds an iteration at the final resolution of both backends, and their losses.

    The reference backend runs twice: with the samples that the kernels take, and with every sample
    of every ray, as without an occupancy grid.
    """
    settings = settings_of(options)
    scene = load_given_scene(options.scene, settings.model)
    scene = replace(scene, free=torch.zeros_like(scene.free))
    every = replace(settings.training, upsample_at=(), iterations=options.iterations)
    present = load_field(options.field) if options.field is not None else None
    if present is not None:
        space = scene.model.space.within(present.bounds)
        model = replace(scene.model, space=space, resolution=present.resolution)
        scene, every = replace(scene, model=model), replace(every, field=present.config)
    exhaustive = replace(every, min_weight=0.0, termination=0.0)
    for kernels, training in (
        (options.kernels, every), ("reference", every), ("reference", exhaustive)
    ):  # fmt: skip
        trainer = trainer_of(scene, replace(settings, training=training), kernels)
        if present is not None:
            if training is not exhaustive:
                trainer.field.density.occupancy = present.density.occupancy
            trainer.field.load_state_dict(
                present.state_dict() | {"density.occupancy": trainer.field.density.occupancy}
            )
        print_row(options, {
            "kernels": trainer.kernels.name, "every_sample": training is exhaustive,
            **timed_steps(trainer, options.iterations),
        })  # fmt: skip


def timed_steps(trainer: FieldTrainer, iterations: int) -> dict[str, Any]:
    """Returns the milliseconds and the losses of all iterations but the first, which compiles."""
    trainer.step()
    first, cpu, losses = trainer.state.seconds, time.process_time(), []
    for _ in range(iterations - 1):
        trainer.step()
        losses.append(10 ** (-trainer.psnr() / 10))
    return {
        "ms_per_iteration": 1e3 * (trainer.state.seconds - first) / (iterations - 1),
        "cpu_ms_per_iteration": 1e3 * (time.process_time() - cpu) / (iterations - 1),
        "losses": losses,
    }


def settings_of(options: argparse.Namespace) -> Settings:
    """Returns the quality's settings with the given ones in their place."""
    values = {
        f"{part}.{name}": value
        for part, family in (("model", "SceneModel"), ("training", "RadianceField"))
        for name, value in settings_for(family, options.quality).items()
    }
    values |= {"training.seed": options.seed}
    for setting in options.set:
        name, _, value = setting.partition("=")
        values[name] = json.loads(value)
    return configured(Settings, values)


def print_row(options: argparse.Namespace, row: dict[str, Any]) -> None:
    """Prints a row."""
    rounded = {k: round(v, 5) if isinstance(v, float) else v for k, v in row.items()}
    print(json.dumps({"scene": options.scene} | rounded), flush=True)  # noqa: T201


def parser() -> argparse.ArgumentParser:
    """Returns the parser of the command line."""
    result = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    modes = result.add_subparsers(required=True)
    for mode in (train, sweep, frame, compare):
        one = modes.add_parser(mode.__name__, help=mode.__doc__)
        one.add_argument("scene")
        if mode is sweep:
            one.add_argument("knob")
            one.add_argument("values", nargs="+")
        one.add_argument("--quality", choices=PRESETS, default="draft")
        one.add_argument("--set", nargs="*", default=[], metavar="NAME=JSON")
        one.add_argument("--kernels")
        one.add_argument("--seed", type=int, default=0)
        one.add_argument("--field", type=Path, required=mode is frame)
        one.add_argument("--at", type=float, nargs="*", default=[], metavar="SECONDS")
        one.add_argument("--repeats", type=int, default=5)
        one.add_argument("--iterations", type=int, default=20)
        one.add_argument("--long-side", type=int, default=0)
        one.set_defaults(run=mode)
    return result


def main() -> None:
    """Runs the mode that the command line names."""
    options = parser().parse_args()
    options.given = len(options.set)
    options.run(options)


if __name__ == "__main__":
    main()
