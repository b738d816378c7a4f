"""Paths and their support: the default one is kept where photographs support it.

Its spread is reduced step by step until less than 2 % of its pixels are seen by fewer than three of
the photographs that the field was fitted to. Where no spread is enough, as where few photographs
surround a scene and hardly any two show the same background, the best one gets a narrower angle of
view, step by step. What is still unsupported is a warning; where that is a fifth or more, stills
take the path's place (`styletrf.trajectory.stills`). A path that the user asks for is left as it
is.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from styletrf.files.tables import write_summary
from styletrf.geometry.cameras import Camera
from styletrf.geometry.lenses import at_size, focal_of, with_focal
from styletrf.scene.scene_model import SceneModel
from styletrf.scene.survey import ENOUGH_VIEWS
from styletrf.trajectory.stills import Still
from styletrf.trajectory.support import Support
from styletrf.trajectory.support_config import SupportConfig
from styletrf.trajectory.trajectories import TrajectoryConfig, fly_through

_LOGGER = logging.getLogger(__name__)
_SHRINKING = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 0.0)  # of the spread that is asked for
_ZOOMS = (1.25, 1.5, 1.75, 2.0)  # of the focal length


@dataclass(frozen=True, slots=True)
class Trial:
    """The share of unsupported pixels of the default path with a spread and a focal length.

    `zoom` is the focal length in units of the photographs', or of what the user asked for.
    """

    spread: float
    zoom: float
    unsupported: float


@dataclass(frozen=True, slots=True)
class SupportedPath:
    """A path, its support, and what was tried for it.

    Where it is made of `stills`, `reason` says why.
    """

    cameras: list[Camera]
    support: Support
    trials: tuple[Trial, ...] = ()
    stills: tuple[Still, ...] = ()
    reason: str = ""


def supported_fly_through(
    cameras: Sequence[Camera],
    model: SceneModel,
    config: TrajectoryConfig,
    measure: Callable[[Sequence[Camera]], Support],
    most_unsupported: float,
) -> SupportedPath:
    """Returns the default path, the widest in spread, then in view, that photographs support.

    The angle of view is left alone where `config` has one. Where nothing is enough, it is the path
    with the least unsupported pixels.

    Args:
        cameras: The photographs', in the normalized world.
        model: Of the scene.
        config: Of the path; its spread is the largest one tried.
        measure: Returns the support of a path.
        most_unsupported: The share of pixels that a path stays below.
    """
    found: list[tuple[Trial, SupportedPath]] = []

    def is_enough(spread: float, zoom: float) -> bool:
        """Returns whether photographs support the path of a spread and a zoom."""
        path = fly_through(cameras, model, replace(config, spread=spread))
        path = [at_size(camera, 0, config.fov_deg) for camera in path]
        path = [with_focal(camera, zoom * focal_of(camera)) for camera in path]
        support = measure(path)
        found.append((Trial(spread, zoom, support.share), SupportedPath(path, support)))
        return support.share < most_unsupported

    def best() -> tuple[Trial, SupportedPath]:
        """Returns the trial with the least unsupported pixels."""
        return min(found, key=lambda one: one[0].unsupported)

    if not any(is_enough(share * config.spread, 1.0) for share in _SHRINKING):
        spread = best()[0].spread
        any(is_enough(spread, zoom) for zoom in (() if config.fov_deg else _ZOOMS))
    return replace(best()[1], trials=tuple(trial for trial, _ in found))


def write_support(file: Path, name: str, path: SupportedPath, config: SupportConfig) -> None:
    """Writes how well a path is supported, and warns where it is not.

    The file has the share of the pixels (`unsupported`), that of each frame looked at, the spreads
    and focal lengths that were tried, and the stills that there are instead, with the reason.
    """
    support = path.support
    summary = {
        "path": name,
        "unsupported": support.share,
        "most_unsupported": config.most_unsupported,
        "enough_photographs": ENOUGH_VIEWS,
        "worst": support.worst(),
        "frames": support.unsupported,
        "tried": [asdict(trial) for trial in path.trials],
        "stills": [asdict(still) for still in path.stills],
        "reason": path.reason,
    }
    write_summary(file, summary)
    if path.stills:
        message = f"the path {name}: stills of {len(path.stills)} photographs, since {path.reason}"
        _LOGGER.warning(message)
    elif support.share >= config.most_unsupported:
        warning = (
            f"the path {name}: fewer than {ENOUGH_VIEWS} photographs see {support.share:.1%} of its"
            f" pixels; worst are the frames {', '.join(support.worst())}"
        )
        _LOGGER.warning(warning)
