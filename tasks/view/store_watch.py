"""Watches a store for the viewer of a scene, and for styles that are added meanwhile."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Event

from pipeline.maintenance.task_graph import stored_tasks
from pipeline.settings import data_root
from styletrf.capture.photographs import PHOTOGRAPH_SUFFIXES
from styletrf.errors import InputError
from styletrf.viewer.baking import BakedLook
from tasks.presets.presets import PRESETS
from tasks.results.scene_in_styles import is_name_of_photographs, require_other_name
from tasks.results.viewer import Viewer
from tasks.stages.stylization import StylizedField
from tasks.view.live_viewer import LiveViewer

POLL_S = 2.0
Bake = Callable[[str], tuple[BakedLook, str]]
"""Returns the look of a style and its thumbnail."""


def known_styles() -> list[str]:
    """Returns the names of the images in the folder of styles, in their order.

    Those that share a name have it with the suffix.
    """
    return list(_paintings())


def _paintings() -> dict[str, Path]:
    """Returns the images in the folder of styles by their names."""
    files = sorted((data_root() / "styles").glob("[!.]*"))
    images = [file for file in files if file.suffix.lower() in PHOTOGRAPH_SUFFIXES]
    count = Counter(file.stem for file in images)
    return {file.stem if count[file.stem] == 1 else file.name: file for file in images}


def adapted_styles(viewer: Viewer) -> list[str]:
    """Returns the styles of a viewer whose fields are in the store, made as its parameters say.

    Not that with the name of the photographs' look.
    """
    return [style for style in _styles_with_fields(viewer) if not is_name_of_photographs(style)]


def _styles_with_fields(viewer: Viewer) -> dict[str, Path]:
    """Returns the paintings whose fields are in the store, by their names."""
    paintings = _paintings()
    fields = {style: viewer.upstream(StylizedField, style=style) for style in paintings}
    return {style: paintings[style] for style, field in fields.items() if _is_complete(field)}


def _is_complete(field: StylizedField) -> bool:
    """Returns whether a field is in the store; if not, its painting is read again the next time.

    Luigi keeps tasks, and a task the digest of its painting, of which the copy may be under way.
    """
    if field.complete():
        return True
    for task in stored_tasks(field):
        if "style" in task.param_kwargs:
            task.forget(sources=True)
    return False


def best_quality(viewers: Sequence[Viewer]) -> Viewer:
    """Returns the viewer with the most styles in the store; of several the one of best quality.

    Args:
        viewers: Viewers without styles, of one scene, at one quality or at several.

    Raises:
        InputError: None has a field and a fly-through; the error has the command that makes them.
    """
    ready = [v for v in viewers if all(task.complete() for task in v.requires().values())]
    if ready:
        return max(ready, key=lambda v: (len(adapted_styles(v)), PRESETS.index(v.quality)))
    scene, style = viewers[0].scene, next(iter(known_styles()), "STYLE")
    problem = "has no field with a fly-through in the store that was made with these settings"
    command = f"luigi --module tasks StylizedTrajectory --scene {scene} --style {style}"
    raise InputError(
        f"scene {scene}", problem, f"Make them: {command} --quality {viewers[0].quality}"
    )


def watch_store(viewer: Viewer, live: LiveViewer, bake: Bake, stop: Event) -> None:
    """Adds the styles of a viewer as they come, until `stop` is set.

    A style that cannot be shown is reported in the page. One that is shown keeps its name there,
    although an image that comes later may give it another one.
    """
    seen, problems = set[Path](), list[str]()
    while not stop.is_set():
        for style, painting in _styles_with_fields(viewer).items():
            if painting in seen or stop.is_set():
                continue
            seen.add(painting)
            live.report = " ".join([*problems, f"{style} is being prepared."])
            try:
                require_other_name(f"style {style}", style)
                live.add(*bake(style))
            except Exception as error:  # noqa: BLE001  the other styles are still shown
                problems.append(f"{style} cannot be shown: {error}")
            live.report = " ".join(problems)
        stop.wait(POLL_S)
