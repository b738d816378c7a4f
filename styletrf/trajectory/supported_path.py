"""Narrows the default path until photographs support it.

The spread of the path is reduced step by step until less than 2 % of its pixels are seen by fewer
than three of the photographs that the field was fitted to. Where no spread is enough, as where few
photographs surround a scene and hardly any two show the same background, the angle of view is
narrowed, step by step. A narrower view is worth its loss where it leaves out margins that no
photograph shows. Gaps behind leaves are everywhere in a frame: there the path keeps the
photographs' angle of view, and the widest spread that is supported nearly as well as any. Along a
walk the spread changes nothing, so the angle of view alone is narrowed. A warning
gives the fraction that is still unsupported; where that is a fifth or more, stills take the path's
place (`styletrf.trajectory.stills`). A path that the user requests is left as it is.
"""

import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from operator import attrgetter
from pathlib import Path

import numpy as np

from styletrf.files.tables import write_summary
from styletrf.geometry.cameras import Camera
from styletrf.geometry.lenses import at_size, focal_of, with_focal
from styletrf.scene.scene_model import SceneModel
from styletrf.scene.survey import ENOUGH_VIEWS
from styletrf.trajectory.stills import Still
from styletrf.trajectory.support import Support
from styletrf.trajectory.support_config import SupportConfig
from styletrf.trajectory.trajectories import fly_through
from styletrf.trajectory.trajectory_config import TrajectoryConfig

_LOGGER = logging.getLogger(__name__)
_SHRINKING = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 0.0)  # of the spread in the settings
_ZOOMS = (1.25, 1.5, 1.75, 2.0)  # of the focal length
_NEARLY_LEAST = 1.25  # times the least fraction of unsupported pixels is nearly as good


@dataclass(frozen=True, slots=True)
class Trial:
    """The fraction of unsupported pixels of the default path with a spread and a focal length.

    `zoom` is the focal length in units of the photographs', or of the one that the user chose.
    """

    spread: float
    zoom: float
    unsupported: float


_fraction = attrgetter("unsupported")


@dataclass(frozen=True, slots=True)
class SupportedPath:
    """A path, its support, and the trials for it.

    `chosen` is the trial that became the path. Where it is made of `stills`, `reason` says why.
    """

    cameras: list[Camera]
    support: Support
    trials: tuple[Trial, ...] = ()
    stills: tuple[Still, ...] = ()
    reason: str = ""
    chosen: Trial | None = None


def supported_fly_through(
    cameras: Sequence[Camera],
    model: SceneModel,
    config: TrajectoryConfig,
    measure: Callable[[Sequence[Camera]], Support],
    limits: SupportConfig,
) -> SupportedPath:
    """Returns the default path, the widest in spread, then in view, that photographs support.

    The angle of view is left alone where `config` has one. A narrower view is enough if the
    fraction of its pixels that are unsupported is below the limit, and falls at least as much as
    the area of the view. Zooming begins at the widest spread with nearly the least fraction. Where
    no view is enough, the path keeps that spread in the photographs' own view. Where that path
    would give way to stills, it is the path with the least fraction.

    Args:
        cameras: The photographs', in the normalized world.
        model: The model of the scene.
        config: The settings of the path; its spread is the largest one tried.
        measure: Returns the support of a path.
        limits: The support that a path needs.
    """
    tried: dict[Trial, SupportedPath] = {}

    def first_supported(
        ways: Iterable[tuple[float, float]], fraction_before: float = np.inf
    ) -> Trial | None:
        """Returns the first spread and zoom that are enough; later ones are not tried."""
        for spread, zoom in ways:
            path = _fly_through_at(cameras, model, config, spread, zoom)
            support = measure(path)
            trial = Trial(spread, zoom, support.fraction)
            tried[trial] = SupportedPath(path, support)
            if trial.unsupported < min(limits.most_unsupported, fraction_before / zoom**2):
                return trial
        return None

    fractions = _SHRINKING[:1] if model.looking == "along" else _SHRINKING
    spreads = dict.fromkeys(fraction * config.spread for fraction in fractions)
    chosen = first_supported((spread, 1.0) for spread in spreads)
    if chosen is None:
        wide = _widest_nearly_best(list(tried))
        zooms = () if config.fov_deg else _ZOOMS
        chosen = first_supported(((wide.spread, zoom) for zoom in zooms), wide.unsupported)
        needs_stills = wide.unsupported >= limits.least_for_stills
        chosen = chosen or (min(tried, key=_fraction) if needs_stills else wide)
    return replace(tried[chosen], trials=tuple(tried), chosen=chosen)


def _fly_through_at(
    cameras: Sequence[Camera], model: SceneModel, config: TrajectoryConfig, spread: float,
    zoom: float,
) -> list[Camera]:  # fmt: skip
    path = fly_through(cameras, model, replace(config, spread=spread))
    path = [at_size(camera, 0, config.fov_deg) for camera in path]
    return [with_focal(camera, zoom * focal_of(camera)) for camera in path]


def _widest_nearly_best(trials: Sequence[Trial]) -> Trial:
    """Returns the first trial, the widest, that has nearly the least unsupported pixels."""
    least = min(map(_fraction, trials))
    return next(trial for trial in trials if trial.unsupported <= _NEARLY_LEAST * least)


def write_support(file: Path, name: str, path: SupportedPath, config: SupportConfig) -> None:
    """Writes how well a path is supported, and warns where it is not.

    The file has the fraction of the pixels (`unsupported`), that of each frame looked at, the
    spreads and focal lengths that were tried, the trial that was chosen, and the stills that there
    are instead, with the reason.
    """
    support = path.support
    summary = {
        "path": name,
        "unsupported": support.fraction,
        "most_unsupported": config.most_unsupported,
        "enough_photographs": ENOUGH_VIEWS,
        "worst": support.worst(),
        "frames": support.unsupported,
        "tried": [asdict(trial) for trial in path.trials],
        "chosen": asdict(path.chosen) if path.chosen else None,
        "stills": [asdict(still) for still in path.stills],
        "reason": path.reason,
    }
    write_summary(file, summary)
    if path.stills:
        message = f"the path {name}: stills of {len(path.stills)} photographs, since {path.reason}"
        _LOGGER.warning(message)
    elif support.fraction >= config.most_unsupported:
        warning = (
            f"the path {name}: fewer than {ENOUGH_VIEWS} photographs see {support.fraction:.1%} of"
            f" its pixels; worst are the frames {', '.join(support.worst())}"
        )
        _LOGGER.warning(warning)
