"""Whether frames look like the painting, by measures no training used: `resemblance.py --help`.

    resemblance.py frames --frames out/horns/mosaic/frames --unstylized FOLDER \
        --painting data/styles/mosaic.jpg --priors out/horns/mosaic/priors --retrieval
    resemblance.py table --scenes horns fern --styles mosaic udnie --per-frame --retrieval
    resemblance.py sheet --scenes horns fern --styles mosaic udnie --to sheet.jpg

A row a result: the ratios of its distances to the painting over those of the unstylized frames
(1: not stylized, 0: the painting itself; sliced Wasserstein distances of colors, of patches, and of
patches without their mean colors (texture), Gram matrices of EfficientNet-Lite0, SIFID with VGG16),
the content ratio, and the sharpness over the priors' and over the unstylized frames'; see
docs/metrics.md. The row `color map` is of the
unstylized frames with the painting's histogram of colors, which paints nothing. `--retrieval` adds
the fraction of frames whose nearest painting is their own, among all under `STYLETRF_DATA` and the
embedded ones. `frames` measures PNG or EXR files in folders, paired by name; `table` and `sheet`
have the tasks make the fields that are missing, and render the frames they look at themselves.
With `--json` rows are JSON and have the distances, too.
"""

import argparse
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import luigi
from contact_sheet import write_sheet
from jury import Jury, Result
from task_of import task_of

from pipeline.settings import data_root
from pipeline.task import artifact
from styletrf.capture.user_folders import find_style
from styletrf.evaluation.resemblance.frame_resemblance import ResemblanceConfig
from styletrf.even_spread import evenly_spread
from styletrf.files.images import read_rgb
from styletrf.geometry.camera_table import read_cameras
from styletrf.steps.stylized_frames import Blend, stylized_frames
from styletrf.trajectory.frames import write_pictures
from tasks.stages.stylization import StylizedFrames
from tasks.stages.weights import PerceptualWeights

COLUMNS = {
    "colors": "style_swd_colors_ratio",
    "patches": "style_swd_patches_ratio",
    "texture": "style_swd_texture_ratio",
    "gram": "style_gram_ratio",
    "sifid": "sifid_vgg_ratio",
    "content": "content",
    "product": "content_style_product",
    "sharp/priors": "sharpness_to_priors",
    "sharp/plain": "sharpness_to_unstylized",
    "own(patches)": "own_style_swd_patches",
    "own(sifid)": "own_sifid_vgg",
}


def frames(options: argparse.Namespace) -> None:
    """Prints the rows of frames in folders."""
    name = options.name or f"{options.frames}"
    result = Result(name, options.painting, options.frames, options.unstylized, options.priors)
    _print_rows([result], options)


def table(options: argparse.Namespace) -> None:
    """Prints the rows of scenes in styles."""
    _print_rows(_made(options), options)


def sheet(options: argparse.Namespace) -> None:
    """Writes a frame of every scene in every style, a row a scene, below the paintings."""
    cells = {}
    for result in _made(options):
        scene, style = result.name.split(" ", 1)
        cells[scene, style] = read_rgb(_middle(result.stylized))
    heads = {style: find_style(data_root(), style) for style in options.styles}
    write_sheet(options.to, heads, options.scenes, cells, options.width)


def _print_rows(results: Iterable[Result], options: argparse.Namespace) -> None:
    config = ResemblanceConfig(frames=options.count)
    jury = Jury(options.vgg or _weights(), config, retrieval=options.retrieval)
    columns = {c: k for c, k in COLUMNS.items() if options.retrieval or "own" not in c}
    if not options.json:
        _print(f"{'':32}" + "".join(f"{c:>13}" for c in columns))
    for result in results:
        for row in jury.rows(result, baseline="per frame" not in result.name):
            values = [row.get(key) for key in columns.values()]
            cells = "".join(f"{'' if v is None else f'{v:.3f}':>13}" for v in values)
            _print(json.dumps(row) if options.json else f"{row['result']:32}{cells}")


def _made(options: argparse.Namespace) -> Iterator[Result]:
    """Yields the requested results, made by the tasks."""
    methods = ["field", "per-frame"] if getattr(options, "per_frame", False) else ["field"]
    words = {"quality": options.quality, **json.loads(options.words)}
    tasks = [
        task_of(StylizedFrames, scene=scene, style=style, method=method, **words)
        for scene in options.scenes
        for style in options.styles
        for method in methods
    ]
    for task in tasks:
        with TemporaryDirectory() as folder:
            yield _result(task, Path(folder), options)


def _result(task: Any, folder: Path, options: argparse.Namespace) -> Result:
    """Returns a result of which only the frames that are looked at are rendered."""
    needed = task.requires()
    _build([*needed.values()])
    inputs = {name: artifact(stage) for name, stage in needed.items()}
    cameras = {c.name: c for c in read_cameras(inputs["trajectory"] / "cameras.parquet")}
    looked_at = [cameras[name] for name in evenly_spread(list(cameras), options.count)]
    blend = Blend(task.strength, task.blend, task.region)
    frames = stylized_frames(inputs, looked_at, task.values(), blend, task.device)
    write_pictures(folder, [camera.name for camera in looked_at], frames)
    suffix = ", per frame" if task.method == "per-frame" else ""
    priors = needed["stylized"].requires()["stylized"] if "stylized" in needed else None
    return Result(
        f"{task.scene} {task.style}{suffix}",
        find_style(data_root(), task.style),
        folder / "frames",
        inputs["trajectory"] / "frames",
        artifact(priors) / "frames" if priors else None,
    )


def _weights() -> Path:
    task = PerceptualWeights()
    _build([task])
    return artifact(task) / "vgg16.safetensors"


def _build(wanted: list[Any]) -> None:
    if not luigi.build(wanted, local_scheduler=True, log_level="WARNING"):
        raise SystemExit("a stage failed")


def _middle(folder: Path) -> Path:
    found = sorted(folder.glob("*.png"))
    return found[len(found) // 2]


def _print(line: str) -> None:
    print(line, flush=True)  # noqa: T201


def main() -> None:
    """Runs the mode that the command line names."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    modes = parser.add_subparsers(required=True)
    one = modes.add_parser("frames", help=frames.__doc__)
    one.add_argument("--frames", type=Path, required=True, help="a folder of PNG files")
    one.add_argument("--unstylized", type=Path, required=True, help="a folder of EXR or PNG files")
    one.add_argument("--painting", type=Path, required=True)
    one.add_argument("--priors", type=Path, help="the painted priors, for sharpness")
    one.add_argument("--name", help="of the row, instead of the folder")
    one.set_defaults(run=frames)
    two = modes.add_parser("table", help=table.__doc__)
    two.add_argument("--per-frame", action="store_true", help="the network frame by frame, too")
    two.set_defaults(run=table)
    three = modes.add_parser("sheet", help=sheet.__doc__)
    three.add_argument("--to", type=Path, required=True, help="a .jpg or .png file")
    three.add_argument("--width", type=int, default=320, help="of a picture, in pixels")
    three.set_defaults(run=sheet, count=3)
    for mode in (two, three):
        mode.add_argument("--scenes", nargs="+", required=True)
        mode.add_argument("--styles", nargs="+", required=True)
        mode.add_argument("--quality", default="draft")
        mode.add_argument("--words", default="{}", help="of StylizedFrames, as JSON")
    for mode in (one, two):
        mode.add_argument("--count", type=int, default=6, help="frames of a result")
        mode.add_argument("--vgg", type=Path, help="vgg16.safetensors instead of the stage's")
        mode.add_argument("--retrieval", action="store_true")
        mode.add_argument("--json", action="store_true")
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
