"""`styletrf view SCENE`: serves the viewer of a scene to this machine, until Ctrl-C."""

import secrets
import signal
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Event, Thread

from luigi.cmdline_parser import CmdlineParser
from luigi.parameter import ParameterException

from pipeline.errors import StoreError
from pipeline.parameters import parameter_errors
from pipeline.settings import current_store, data_root, out_root
from pipeline.task import artifact
from styletrf.capture.photograph_names import composed
from styletrf.capture.user_folders import find_scene
from styletrf.errors import InputError
from styletrf.field.radiance_field import load_field, load_stylized_field
from styletrf.steps.viewer_page import PHOTOGRAPHS
from styletrf.trajectory.path_files import read_path
from styletrf.viewer.baking import BakedLook
from styletrf.viewer.viewed_scene import read_viewed_scene, thumbnail
from styletrf.viewer.viewer_content import bake_scene
from tasks.presets.presets import PRESETS
from tasks.results.viewer import Viewer
from tasks.stages.style import StyleImage
from tasks.stages.stylization import StylizedField
from tasks.view.live_viewer import LiveViewer
from tasks.view.page_server import LOOPBACK, PageServer, warning_of
from tasks.view.path_command import path_command
from tasks.view.store_watch import Bake, adapted_styles, best_quality, known_styles, watch_store

_DESCRIPTION = """Serves the viewer of a scene, with the styles that are in the store and those that
come, and saves the camera paths drawn in it. What else is given, such as --content embedded, is
what the fields were made with, as in the command that made them."""


def run(arguments: Sequence[str]) -> int:
    """Runs the command; returns its exit status.

    Raises:
        SystemExit: The command is refused, or prints a help.
    """
    given, others = parser().parse_known_args(arguments)
    try:
        with parameter_errors():
            return _serve(given, others)
    except (InputError, StoreError, ParameterException) as error:
        raise SystemExit(str(error)) from error
    except (KeyboardInterrupt, SystemError) as error:
        if not _is_interrupt(error):
            raise
        return 0


def _is_interrupt(error: BaseException | None) -> bool:
    """Returns whether Ctrl-C caused an error: numba turns it into a `SystemError`."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def parser() -> ArgumentParser:
    """Returns the parser of the command's own options; the others are those of its task."""
    parser = ArgumentParser("styletrf view", description=_DESCRIPTION, allow_abbrev=False)
    parser.add_argument("scene", type=composed, help="a folder in data/scenes")
    parser.add_argument(
        "--quality", choices=PRESETS, help="by default the one with the most styles in the store"
    )
    parser.add_argument(
        "--host",
        default=LOOPBACK,
        help="the address to listen on, by default 127.0.0.1, which only this machine reaches",
    )
    parser.add_argument("--port", type=int, default=0, help="by default a free one")
    parser.add_argument(
        "--path-file", type=Path, help="where paths are saved; out/SCENE/camera-path.json"
    )
    return parser


def _serve(given: Namespace, others: Sequence[str]) -> int:
    find_scene(data_root(), given.scene)
    current_store(create=False)
    file = (given.path_file or out_root() / given.scene / "camera-path.json").absolute()
    _require_path_file(file)
    line = ["Viewer", "--scene", given.scene, "--styles", "[]", *others]
    with (
        CmdlineParser.global_instance(line) as parser,
        PageServer(given.host, given.port, secrets.token_urlsafe(24)) as server,
    ):
        viewer = _viewer(parser.get_task_obj(), given)
        print(f"Preparing {viewer.scene} at {viewer.quality} ...", flush=True)  # noqa: T201
        live, bake = _live_viewer(viewer, file, others)
        server.site, stop = live, Event()
        watch = Thread(target=watch_store, args=(viewer, live, bake, stop), daemon=True)
        watch.start()
        _print_address(server)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            stop.set()
        watch.join(timeout=1)
        if watch.is_alive():  # within native code, during which an interpreter cannot end
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            signal.raise_signal(signal.SIGINT)
        return 0


def _require_path_file(file: Path) -> None:
    """Refuses to replace a file that is not key frames."""
    if file.exists() and (file.is_dir() or read_path(file).of_given_poses):
        raise InputError(str(file), "is not a file of key frames", "Give another --path-file")


def _viewer(viewer: Viewer, given: Namespace) -> Viewer:
    """Returns the viewer that is served, without its styles."""
    if viewer.styles:
        problem = "does not belong to this command, which shows all styles in the store"
        raise InputError(f"--styles {list(viewer.styles)}", problem, "Leave it out")
    qualities = [given.quality] if given.quality else PRESETS
    viewers = [
        viewer.clone(quality=quality)  # type: ignore[no-untyped-call]
        for quality in qualities
    ]
    viewers[0].validate()
    return best_quality(viewers)


def _live_viewer(viewer: Viewer, file: Path, others: Sequence[str]) -> tuple[LiveViewer, Bake]:
    """Returns the served site, with the photographs, and the function that bakes the styles."""
    inputs = {name: artifact(task) for name, task in viewer.requires().items()}
    scene, field = read_viewed_scene(inputs), load_field(inputs["field"])
    content, baking = bake_scene(
        viewer.scene, scene.model, (PHOTOGRAPHS, field), scene.photographed, scene.path
    )

    def bake(style: str) -> tuple[BakedLook, str]:
        stylized = artifact(viewer.upstream(StylizedField, style=style))
        image = artifact(viewer.upstream(StyleImage, style=style)) / "style.png"
        look = baking.baked(style, load_stylized_field(inputs["field"], stylized))
        return look, thumbnail(image)

    def command(weights: Mapping[str, float], seconds: float) -> str:
        made_with = ["--scene", viewer.scene, "--quality", viewer.quality, *others]
        first = next(iter([*adapted_styles(viewer), *known_styles()]), "STYLE")
        return path_command(file, seconds, weights, made_with, first)

    live = LiveViewer(content, [scene.thumbnail], scene.frames_per_second, file, command)
    return live, bake


def _print_address(server: PageServer) -> None:
    """Prints where the page is, and a warning where other machines reach it."""
    if warning := warning_of(server.host):
        sys.stderr.write(warning + "\n")
    print(f"Ctrl-C stops it. Open\n{server.address}", flush=True)  # noqa: T201
