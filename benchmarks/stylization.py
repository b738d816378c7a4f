"""What a stylized field costs and reaches: `python benchmarks/stylization.py --help`.

    stylization.py adapt horns mosaic --priors 20 --set adaptation.iterations=600
    stylization.py adapt horns mosaic --uncached
    stylization.py strategies horns mosaic

Scenes and styles lie below `STYLETRF_DATA`; the scene and its painted priors are made by the tasks.
A row of JSON is printed a measurement. `adapt` tells the PSNR of renders of the adapted field
against the painted priors, and against the frames of the trajectory as the network paints them one
by one. Without the cache every iteration marches its rays anew and keeps every sample. `strategies`
compares S3, S2 and S1 by the PSNR to the priors and by how far the depth of the priors' views is
from the unstylized field's.
"""

import argparse
import json
import resource
import time
from collections.abc import Iterator
from dataclasses import replace

import build_environment  # noqa: F401
import luigi
import torch
from task_of import task_of

from pipeline.task import artifact
from styletrf.capture.view_images import view_images
from styletrf.configuration import configured
from styletrf.evaluation.metrics import psnr
from styletrf.field.radiance_field import RadianceField, load_stylized_field
from styletrf.field.ray_cache import RayBatch, march_once
from styletrf.field.rendering import RenderConfig, Rendering
from styletrf.field.view_rays import ViewRays
from styletrf.files.float_images import read_float_image
from styletrf.files.images import read_rgb
from styletrf.geometry.camera_table import read_cameras
from styletrf.stylization.adaptation import AdaptationConfig, fit_appearance
from styletrf.stylization.color_transfer import in_colors
from styletrf.stylization.painters import network_painter, painted
from styletrf.stylization.strategies import (
    Stylization,
    StylizationConfig,
    load_stylization,
    stylized,
)
from styletrf.trajectory.frames import rendered
from tasks.presets.presets import settings_for
from tasks.stages.stylization import StylizedField


def adapt(options: argparse.Namespace) -> None:
    """Prints what adaptations of a field to painted priors reach."""
    values = settings_for("StylizedField", "draft")
    for setting in options.set:
        name, _, value = setting.partition("=")
        values[name] = json.loads(value)
    whole = configured(StylizationConfig, values)
    config = whole.adaptation
    if options.priors:
        usual = {**settings_for("PriorRenders", "draft"), "coverage.count": options.priors}
        luigi.configuration.get_config().set("PriorRenders", "settings", json.dumps(usual))
    stage = task_of(StylizedField, scene=options.scene, style=options.style, quality="draft")
    needed = stage.requires()
    if not luigi.build(list(needed.values()), local_scheduler=True, log_level="WARNING"):
        raise SystemExit("a stage before failed")
    inputs = {name: artifact(task) for name, task in needed.items()}
    job = load_stylization(inputs, torch.device("cpu"), "pixels")
    started, cpu = time.monotonic(), time.process_time()
    if options.uncached:
        fit_appearance(job.field.appearance, _marched_anew(job, config), config, job.kernels)
    else:
        stylized(job, whole)
    row = {
        "scene": options.scene, "style": options.style, "priors": len(job.cameras),
        "uncached": options.uncached, "seconds": time.monotonic() - started,
        "cpu_seconds": time.process_time() - cpu, "psnr_to_priors": _to_priors(job),
        "psnr_to_painted_frames": _to_painted_frames(job, stage),
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }  # fmt: skip
    print(json.dumps(row), flush=True)  # noqa: T201


def _marched_anew(job: Stylization, config: AdaptationConfig) -> Iterator[RayBatch]:
    field, generator = job.field, torch.Generator().manual_seed(config.seed)
    rays = ViewRays(
        job.cameras, job.model.space.within(field.bounds), field.step_length, job.painted.device
    )
    images = view_images(job.painted)
    for _ in range(config.iterations):
        draws = torch.randint(len(images), (config.batch,), generator=generator)
        cache = march_once(
            field, rays, images, draws, job.kernels,
            min_weight=0.0, termination=1e-4, cache_bytes=1 << 40, generator=generator,
        )  # fmt: skip
        yield cache.batch(0, config.batch)


def _to_priors(job: Stylization) -> float:
    errors = [
        (r.color - p.float() / 255).square().mean()
        for r, p in zip(_views(job, job.field), job.painted, strict=True)
    ]
    return float(-10 * torch.stack(errors).mean().log10())


def _to_painted_frames(job: Stylization, stage: StylizedField) -> float:
    """Returns the PSNR of every sixth frame against what the network paints of it by itself."""
    painter = stage.requires()["stylized"]
    priors, network = painter.requires()["priors"], painter.requires()["network"]
    folder = artifact(priors.requires()["trajectory"])
    cameras = read_cameras(folder / "cameras.parquet")[::6]
    plain = [read_float_image(folder / "frames" / f"{c.name}.exr").color for c in cameras]
    paint = network_painter(artifact(network), torch.device("cpu"))
    style = read_rgb(artifact(painter.requires()["style"]) / "style.png")
    wanted = in_colors(painted(paint, [c.name for c in cameras], plain), plain, style, "style")
    shown = rendered(
        job.field, job.model.space, cameras, RenderConfig(1e-3, 1e-3), torch.device("cpu")
    )
    values = [psnr(r.color.numpy(), w) for r, w in zip(shown, wanted, strict=True)]
    return sum(values) / len(values)


def _views(job: Stylization, field: RadianceField) -> Iterator[Rendering]:
    render = RenderConfig(termination=1e-4, min_weight=1e-4)
    return rendered(field, job.model.space, job.cameras, render, torch.device("cpu"))


def strategies(options: argparse.Namespace) -> None:
    """Prints how near to the priors and how far from the geometry each strategy comes."""
    for strategy in ("s3", "s2", "s1"):
        stage = task_of(
            StylizedField,
            scene=options.scene,
            style=options.style,
            quality="draft",
            strategy=strategy,
        )
        if not luigi.build([stage], local_scheduler=True, log_level="WARNING"):
            raise SystemExit("a stage before failed")
        inputs = {name: artifact(task) for name, task in stage.requires().items()}
        job = load_stylization(inputs, torch.device("cpu"), "pixels")
        own = load_stylized_field(inputs["field"], artifact(stage))
        errors = [
            ((a.median_depth - b.median_depth).abs() / b.median_depth).flatten()
            for a, b in zip(_views(job, own), _views(job, job.field), strict=True)
        ]
        error = torch.cat(errors)
        error = torch.where(error.isnan(), 0, error)  # infinite in both
        row = {
            "strategy": strategy,
            "psnr_to_priors": _to_priors(replace(job, field=own)),
            "median_depth_error": float(error.median()),
            "beyond_5_percent": float((error > 0.05).float().mean()),
        }
        print(json.dumps(row), flush=True)  # noqa: T201


def main() -> None:
    """Runs the mode that the command line names."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    modes = parser.add_subparsers(required=True)
    one = modes.add_parser("adapt", help=adapt.__doc__)
    one.add_argument("scene")
    one.add_argument("style")
    one.add_argument("--priors", type=int, default=0, help="how many, instead of as many as cover")
    one.add_argument("--uncached", action="store_true")
    one.add_argument("--set", nargs="*", default=[], metavar="NAME=JSON")
    one.set_defaults(run=adapt)
    two = modes.add_parser("strategies", help=strategies.__doc__)
    two.add_argument("scene")
    two.add_argument("style")
    two.set_defaults(run=strategies)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
