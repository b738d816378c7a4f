"""How the pipeline does with captures as people have them: `python benchmarks/hard_captures.py`.

    hard_captures.py courtyard horns --kinds every_fifth foreign --iterations 600 --long-side 252
    hard_captures.py facade statue plate --kinds as_they_are --path

Each kind of `hard_photographs.MAKERS` is made from each scene (below `STYLETRF_DATA`; `courtyard`
and those of `places.PLACES` are rendered) and goes through all stages up to the held-out views.
A row of Markdown is printed for each: photographs registered, held-out PSNR in dB, the fly-through,
seconds of all stages together, and what was said. `--poses` stops after the poses. `--path` also
makes the frames without a style, and the row has the percentage of their pixels that fewer than
three photographs show, or the number of stills.
"""

import argparse
import json
import os
import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir
from typing import Any

import luigi
import numpy as np
from hard_photographs import FOREIGN, MAKERS, Source, photographs_of
from places import PLACES, write_place
from task_of import task_of

from pipeline.errors import TaskFailure
from pipeline.settings import data_root
from pipeline.task import artifact
from styletrf.capture.poses.given_poses import GivenView, Lens
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.content.procedural_images import procedural_image
from styletrf.files.images import write_png
from styletrf.geometry.camera_table import read_cameras
from styletrf.synthetic.courtyard import CourtyardConfig
from styletrf.synthetic.courtyard.folder import write_courtyard
from tasks.stages.field import TrajectoryFrames
from tasks.stages.metrics import QualityMetrics
from tasks.stages.scene import CameraPoses, SceneCapture
from tasks.stages.stage import Stage

FAMILIES = (SceneCapture, CameraPoses, QualityMetrics)


@dataclass(frozen=True)
class Row:
    """What became of one capture; `psnr` is NaN where there is no field.

    `psnr_exposed` is that of held-out views in their own exposure, where photographs have one each.
    """

    scene: str
    kind: str
    registered: str
    psnr: float
    psnr_exposed: float
    path: str
    seconds: float
    said: str

    def __str__(self) -> str:
        psnr = "" if np.isnan(self.psnr) else f"{self.psnr:.2f}"
        if not np.isnan(self.psnr_exposed):
            psnr += f"; {self.psnr_exposed:.2f} in their own exposure"
        cells = (self.scene, self.kind.replace("_", " "), self.registered, psnr, self.path)
        return f"| {' | '.join(cells)} | {self.seconds:.0f} | {self.said} |"


def source_of(scene: str, elsewhere: str, root: Path, folder: Path) -> Source:
    """Returns the photographs and the poses of a scene; the courtyard's are made in `folder`."""
    place, other = (_place(name, root, folder) for name in (scene, elsewhere))
    if scene == "courtyard" or scene in PLACES:
        views: tuple[GivenView, ...] = tuple(_true_views(place))
    else:
        given = find_given_poses(place)
        views = given.views if given else ()
    if (place / "images").is_dir() or not views:
        return Source(photographs_of(place), photographs_of(other), views)
    first: dict[str, GivenView] = {}  # of each name: the makers copy all files into one folder
    for view in views:
        first.setdefault(view.file.name, view)
    files = [view.file for view in first.values()]
    return Source(files, photographs_of(other), tuple(first.values()))


def _place(scene: str, root: Path, folder: Path) -> Path:
    """Returns the folder of a scene; some are rendered, `leaves` are procedural images."""
    if scene == "courtyard":
        write_courtyard(folder / scene, CourtyardConfig())
    elif scene in PLACES:
        write_place(scene, folder / scene)
    elif scene == "leaves":
        (folder / scene / "images").mkdir(parents=True, exist_ok=True)
        rng = np.random.default_rng(0)
        for index in range(FOREIGN):
            path = folder / scene / "images" / f"{index}.png"
            write_png(path, procedural_image(rng, 300, 400), compression=1)
    else:
        return root / "scenes" / scene
    return folder / scene


def _true_views(place: Path) -> Iterator[GivenView]:
    for camera in read_cameras(place / "truth" / "cameras.parquet"):
        params = (camera.fx, camera.fy, camera.cx, camera.cy)
        lens = Lens("PINHOLE", params, camera.width, camera.height)
        yield GivenView(place / "images" / camera.name, lens, camera.world_from_camera)


def measured(scene: str, kind: str, last: Stage, seconds: float, error: str) -> Row:
    """Returns the row of a capture whose last stage was built, or ended with an error."""
    poses = _summary(last if isinstance(last, CameraPoses) else last.requires()["poses"], "poses")
    capture = _summary(CameraPoses(**_words(last)).requires()["capture"], "capture")
    quality = _summary(last, "summary") if isinstance(last, QualityMetrics) else {}
    registered = f"{poses['registered']} of {poses['total']}" if poses else ""
    remarks = [f"**{error}**"] if error else []
    remarks += [*capture.get("warnings", ()), *poses.get("warnings", ())]
    if poses and not poses["mapper"].startswith("given"):
        remarks.append(f"{poses['matcher']}; {poses['mapper_reason']}")
    psnr, exposed = (float(quality.get(name, np.nan)) for name in ("psnr", "psnr_exposed"))
    path = path_of(TrajectoryFrames(**_words(last)))
    return Row(scene, kind, registered, psnr, exposed, path, seconds, "; ".join(remarks))


def path_of(frames: Stage) -> str:
    """Returns what became of the fly-through, in words; nothing where it was not made."""
    support = _summary(frames, "support")
    if not support:
        return ""
    unsupported = f"{support['unsupported']:.1%} unsupported"
    stills = support.get("stills", ())
    return f"{len(stills)} stills: {support['reason']}" if stills else unsupported


def _summary(task: Any, name: str) -> dict[str, Any]:
    """Returns a JSON file of a stage's artifact; nothing where it was not made."""
    if not task.complete():
        return {}
    return dict(json.loads((artifact(task) / f"{name}.json").read_text()))


def _words(task: Stage) -> dict[str, Any]:
    return {name: task.param_kwargs[name] for name in ("scene", "quality", "tuning")}


def built(stages: Sequence[Stage]) -> tuple[float, str]:
    """Builds stages with all before them; returns the seconds, and the error that ended them."""
    failures: list[BaseException] = []
    handler = luigi.Task.event_handler(luigi.Event.FAILURE)
    handler(lambda _, error: failures.append(error))
    started = time.monotonic()
    luigi.build(stages, local_scheduler=True, log_level="WARNING")
    failure = failures[-1] if failures else None
    if isinstance(failure, TaskFailure):
        kind = "refused" if failure.kind == "user" else failure.kind.upper()
        return time.monotonic() - started, f"{kind}: {failure.reason}"
    return time.monotonic() - started, repr(failure) if failure else ""


def main() -> None:
    """Makes the captures that the command line names, and prints their rows."""
    options = parser().parse_args()
    root, folder = data_root(), options.folder.absolute()
    os.environ["STYLETRF_DATA"] = str(folder)
    os.environ.setdefault("STYLETRF_STORE", str(folder / "store"))
    heads = ("scene", "capture", "registered", "PSNR, dB", "fly-through", "s", "what was said")
    print(f"| {' | '.join(heads)} |\n" + "|---" * len(heads) + "|")  # noqa: T201
    for scene in options.scenes:
        source = source_of(scene, options.elsewhere, root, folder)
        for kind in options.kinds:
            name = f"{scene}-{kind}"
            made = folder / "scenes" / name
            rmtree(made, ignore_errors=True)
            MAKERS[kind](source, made, np.random.default_rng(zlib.crc32(name.encode())))
            stage = CameraPoses if options.poses else QualityMetrics
            words = {"scene": name, "quality": "draft", "tuning": tuning_of(options)}
            last = task_of(stage, **words)
            stages = [last, task_of(TrajectoryFrames, **words)] if options.path else [last]
            print(measured(scene, kind, last, *built(stages)), flush=True)  # noqa: T201


def tuning_of(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Returns the settings that make a row quick."""
    return {
        "CameraPoses": {"max_image_long_side": options.poses_long_side},
        "SceneModel": {"image_long_side": options.long_side},
        "RadianceField": {"iterations": options.iterations},
    }


def parser() -> argparse.ArgumentParser:
    """Returns the parser of the command line."""
    result = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    result.add_argument("scenes", nargs="+")
    result.add_argument("--kinds", nargs="+", choices=MAKERS, default=list(MAKERS))
    result.add_argument(
        "--elsewhere", default="leaves", help="the other place's scene; leaves are made"
    )
    result.add_argument("--poses", action="store_true", help="stop after the poses")
    result.add_argument("--path", action="store_true", help="make the frames of the fly-through")
    result.add_argument("--iterations", type=int, default=5000)
    result.add_argument("--long-side", type=int, default=504)
    result.add_argument("--poses-long-side", type=int, default=1600)
    result.add_argument(
        "--folder", type=Path, default=Path(gettempdir()) / "hard_captures", help="for captures"
    )
    return result


if __name__ == "__main__":
    main()
