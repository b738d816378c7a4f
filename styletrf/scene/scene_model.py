"""The model a scene requires, decided from its cameras and sparse points.

The world is normalized once, by the similarity `normalized_from_world`; every later stage reads
its cameras through it. `scene.json` holds each decision with the quantity it was decided from.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from operator import methodcaller
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from styletrf.configuration import require_at_least
from styletrf.errors import InputError
from styletrf.finiteness import Named, require_finite, require_finite_file
from styletrf.geometry.cameras import Camera, camera_numbers, fitted_to, moved
from styletrf.geometry.space import Space
from styletrf.geometry.typical_view import typical_view
from styletrf.scene.box import place_in_box
from styletrf.scene.contraction import octaves_lost, place_unbounded
from styletrf.scene.explained_pixels import ExplainedPixels
from styletrf.scene.exposure_choice import LEAST_SPREAD, ExposureEvidence
from styletrf.scene.exposures import Exposure
from styletrf.scene.ndc import forward_facing_evidence, place_in_ndc
from styletrf.scene.placement import Looking, Placement
from styletrf.scene.upright_capture import upright_capture
from styletrf.scene.view_dependence import ENOUGH_POINTS, LEAST_FRACTION, ViewDependence

Shading = Literal["network", "plain"]
_SMALLEST_PX = 16  # of a side that a style network can paint


@dataclass(frozen=True, slots=True)
class SceneModelConfig:
    """Settings that the photographs do not decide.

    `space`, `shading` and `exposure` (`one` for all photographs, or `each` its own) override the
    decisions; `image_long_side` is the working size in pixels;
    `max_voxels` bounds the finest grid, `max_box_voxels` that of a box (0: as any other);
    `oversampling` is its lattice points per pixel along x and y of NDC.
    """

    space: Literal["auto", "ndc", "box", "unbounded"] = "auto"
    shading: Literal["auto", "network", "plain"] = "auto"
    exposure: Literal["auto", "one", "each"] = "auto"
    image_long_side: int = 504
    max_voxels: int = 256**3
    max_box_voxels: int = 0
    oversampling: float = 0.75

    def __post_init__(self) -> None:
        require_at_least(_SMALLEST_PX, self, "image_long_side")
        require_at_least(1, self, "max_voxels")
        require_at_least(0, self, "max_box_voxels")
        if self.oversampling <= 0:
            raise ValueError(f"oversampling is {self.oversampling:g}, not above 0")

    def bound(self, space_kind: str) -> int:
        """Returns the most voxels of the finest grid in a space of this kind."""
        is_own = space_kind == "box" and self.max_box_voxels > 0
        return self.max_box_voxels if is_own else self.max_voxels


@dataclass(frozen=True, slots=True)
class SceneModel:
    """A scene's space, finest resolution, shading, working image size and center of interest."""

    space: Space
    normalized_from_world: Float[np.ndarray, "4 4"]
    resolution: tuple[int, int, int]
    shading: Shading
    image_width: int
    image_height: int
    focus: tuple[float, float, float]  # the point that a trajectory looks at, normalized world
    looking: Looking  # how the photographers did; outward is away from the focus
    evidence: dict[str, Any]
    exposures: dict[str, Exposure] = field(default_factory=dict)  # by photograph; none: all alike

    def normalized(self, cameras: Sequence[Camera], long_side_px: int = 0) -> list[Camera]:
        """Returns the cameras in the normalized world, at the working size or that given."""
        long_side = long_side_px or max(self.image_width, self.image_height)
        return [
            moved(fitted_to(camera, long_side), self.normalized_from_world) for camera in cameras
        ]


BOX_EXPLAINS = 0.9  # of the photographs' pixels: below, too many show what is outside
FINE_ENOUGH = 0.5  # octaves lost, below which a box is as good as any space
MOST_LOSS = 0.25  # octaves by which unbounded space may lose more than a box: nothing is outside
LEAST_POINTS = 16  # along an axis of the grid, whatever the bound on all


def decide_scene_model(
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
    config: SceneModelConfig,
    dependence: ViewDependence | None = None,
    explained: ExplainedPixels | None = None,
    exposure: ExposureEvidence | None = None,
) -> SceneModel:
    """Returns the model of a scene.

    The space is NDC (forward-facing) when one frustum holds all views without being much wider than
    one, and the near points lie in front of every camera. Otherwise it is a box around the points;
    but unbounded space around an inner box where the box explains too little of the photographs, or
    where the unbounded lattice is as near to their resolution and the photographs show more than an
    object on a ground of one color. Colors do not depend on the view if
    `dependence` shows that they need not; photographs have exposures of their own if `exposure`
    shows that they differ.

    Args:
        cameras: The cameras of the photographs.
        points_world: Sparse points.
        config: The settings that the photographs do not decide.
        dependence: The dependence of colors on the view, where it was measured.
        explained: The fractions of the pixels that a box explains; None: its points explain all.
        exposure: The exposures of the photographs, where they were estimated.

    Raises:
        InputError: There are too few points to see where the scene is, the space that is set cannot
            hold it, or the working size is too small to be painted.
        NotFiniteError: A point, a camera or the model is not finite.
    """
    named = [("sparse points", points_world), *map(camera_numbers, cameras)]
    require_finite("scene model", "as it was given", named)
    if len(points_world) < 16:
        raise InputError(
            "sparse points",
            f"only {len(points_world)} points were reconstructed, too few to place the scene",
            "Take more overlapping photographs of textured surfaces",
        )
    view = _working_view(cameras, config)
    placement = _placed(cameras, points_world, config, explained or ExplainedPixels())
    shading, of_shading = _shading(config, dependence)
    exposures, of_exposure = _exposures(config, exposure)
    model = _sized(placement, view, shading, config.bound(placement.space.kind))
    evidence = model.evidence | {"shading": of_shading, "exposure": of_exposure}
    model = replace(model, exposures=exposures, evidence=evidence)
    made_of = f"of {len(cameras)} cameras and {len(points_world)} points"
    require_finite("scene model", made_of, _numbers(model))
    return model


def _working_view(cameras: Sequence[Camera], config: SceneModelConfig) -> Camera:
    """Returns the typical camera at the working size; refuses one with too short a side."""
    photograph = typical_view(cameras)
    view = fitted_to(photograph, config.image_long_side)
    if min(view.width, view.height) >= _SMALLEST_PX:
        return view
    short, long = sorted((photograph.width, photograph.height))
    needed = math.ceil(_SMALLEST_PX * long / short)
    remedy = f"Give photographs with at least {_SMALLEST_PX} pixels a side"
    if needed <= long:
        remedy = f"""Set --SceneModel-settings '{{"image_long_side": {needed}}}' or more"""
    raise InputError(
        f"image_long_side {config.image_long_side}",
        f"photographs are worked on at {view.width}x{view.height} pixels, and at least"
        f" {_SMALLEST_PX} a side are needed to paint them",
        remedy,
    )


def _placed(
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
    config: SceneModelConfig,
    explained: ExplainedPixels,
) -> Placement:
    """Returns the scene in the space that the evidence or the configuration names."""
    evidence = forward_facing_evidence(cameras, points_world)
    if config.space == "ndc" or (config.space == "auto" and evidence["forward_facing"]):
        placement = place_in_ndc(cameras, points_world, config.image_long_side, config.oversampling)
    else:
        scene = upright_capture(cameras, points_world, config.image_long_side)
        lost = octaves_lost(scene, config.bound)
        is_as_fine = lost["box"] > FINE_ENOUGH and lost["unbounded"] < lost["box"] + MOST_LOSS
        needed = explained.by_box < BOX_EXPLAINS or (is_as_fine and not explained.is_cut_out)
        evidence |= {"octaves_lost": lost, "fine_enough": FINE_ENOUGH, "most_loss": MOST_LOSS}
        evidence |= {"explained_by_box": explained.by_box, "enough_explained": BOX_EXPLAINS}
        evidence |= {"is_cut_out": explained.is_cut_out, "ground": explained.by_ground}
        is_box = config.space == "box" or (config.space == "auto" and not needed)
        placement = (place_in_box if is_box else place_unbounded)(scene, config.oversampling)
    by = "evidence" if config.space == "auto" else "setting"
    evidence |= {"chosen": placement.space.kind, "by": by}
    return replace(placement, evidence=placement.evidence | {"space": evidence})


def _numbers(model: SceneModel) -> list[Named]:
    space = model.space
    return [
        ("normalized_from_world", model.normalized_from_world),
        ("grid_from_world", space.grid_from_world),
        ("axis_lengths", np.array([*space.axis_lengths, space.depth_min])),
        ("focus", np.array(model.focus)),
    ]


def _shading(
    config: SceneModelConfig, dependence: ViewDependence | None
) -> tuple[Shading, dict[str, Any]]:
    """Returns whether colors depend on the view, and the evidence."""
    evidence: dict[str, Any] = {"by": "evidence" if config.shading == "auto" else "setting"}
    if dependence is not None:
        thresholds = {"share_threshold": LEAST_FRACTION, "points_threshold": ENOUGH_POINTS}
        evidence |= asdict(dependence) | thresholds
    if config.shading != "auto":
        return config.shading, evidence
    return "plain" if dependence is not None and not dependence.needed else "network", evidence


def _exposures(
    config: SceneModelConfig, found: ExposureEvidence | None
) -> tuple[dict[str, Exposure], dict[str, Any]]:
    """Returns the photographs' exposures, none where all have the same, and the evidence."""
    is_auto = config.exposure == "auto"
    evidence: dict[str, Any] = {"by": "evidence" if is_auto else "setting"}
    if found is None:
        return {}, evidence | {"chosen": "one"}
    evidence |= {"spread": found.spread, "disagreement": found.disagreement}
    evidence |= {"spread_threshold": LEAST_SPREAD, "ratio_threshold": found.least_ratio}
    is_each = found.needed if is_auto else config.exposure == "each"
    chosen = "each" if is_each else "one"
    return found.exposures if is_each else {}, evidence | {"chosen": chosen}


def write_scene_model(path: Path, model: SceneModel) -> None:
    """Writes `scene.json`."""
    text = json.dumps(asdict(model), default=methodcaller("tolist"), indent=1, sort_keys=True)
    path.write_text(text + "\n")


def read_scene_model(path: Path) -> SceneModel:
    """Returns the model in `scene.json`.

    Raises:
        InputError: The model is not finite.
    """
    values = json.loads(path.read_text())
    space = values.pop("space")
    space["grid_from_world"] = np.array(space["grid_from_world"])
    space["axis_lengths"] = tuple(space["axis_lengths"])
    values["normalized_from_world"] = np.array(values["normalized_from_world"])
    values["resolution"] = tuple(values["resolution"])
    values["focus"] = tuple(values["focus"])
    values["exposures"] = {
        name: Exposure(tuple(each["log_gain"]), tuple(each["power"]))
        for name, each in values["exposures"].items()
    }
    model = SceneModel(space=Space(**space), **values)
    require_finite_file(path, _numbers(model))
    return model


def _sized(placement: Placement, view: Camera, shading: Shading, max_voxels: int) -> SceneModel:
    """Returns the model with the wanted resolution brought under the bound on voxels."""
    wanted = np.maximum(np.array(placement.resolution), LEAST_POINTS)
    points = _bounded(wanted, max_voxels)
    nx, ny, nz = (round(float(n)) for n in points)
    resolution = {
        "wanted": wanted.tolist(),
        "shrunk_by": float((points.prod() / wanted.prod()) ** (1 / 3)),
        "max_voxels": max_voxels,
    }
    return SceneModel(
        space=placement.space,
        normalized_from_world=placement.normalized_from_world,
        resolution=(nx, ny, nz),
        shading=shading,
        image_width=view.width,
        image_height=view.height,
        focus=placement.focus,
        looking=placement.looking,
        evidence={**placement.evidence, "resolution": resolution},
    )


def _bounded(points: Float[np.ndarray, " 3"], bound: int) -> Float[np.ndarray, " 3"]:
    """Returns the points along each axis, shrunk alike until their product is within the bound.

    An axis that reaches `LEAST_POINTS` stays there and leaves the rest to the others.
    """
    for _ in range(3):
        above = max(int((points > LEAST_POINTS).sum()), 1)
        shrink = min(1.0, (bound / points.prod()) ** (1 / above))
        points = np.maximum(points * shrink, LEAST_POINTS)
    return points
