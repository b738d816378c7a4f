"""The model a scene requires, decided from its cameras and sparse points.

The world is normalised once, by the similarity `normalized_from_world`; every later stage reads
its cameras through it. `scene.json` holds each decision with the quantity it was decided from.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from styletrf.cameras import Camera, fitted_to, moved, project
from styletrf.errors import InputError
from styletrf.space import Space


@dataclass(frozen=True, slots=True)
class SceneModelConfig:
    """What the photographs do not decide.

    `space` overrides the decision; `image_long_side` is the working size in pixels; `max_voxels`
    bounds the finest grid; `oversampling` is its lattice points per pixel along x and y of NDC.
    """

    space: Literal["auto", "ndc", "box"] = "auto"
    image_long_side: int = 504
    max_voxels: int = 256**3
    oversampling: float = 0.75


@dataclass(frozen=True, slots=True)
class SceneModel:
    """A scene's space, finest resolution, working image size and centre of interest."""

    space: Space
    normalized_from_world: Float[np.ndarray, "4 4"]
    resolution: tuple[int, int, int]
    image_width: int
    image_height: int
    focus: tuple[float, float, float]  # what a trajectory looks at, normalised world
    evidence: dict[str, Any]

    def normalized(self, cameras: Sequence[Camera]) -> list[Camera]:
        """Returns the cameras in the normalised world at the working size."""
        long_side = max(self.image_width, self.image_height)
        return [
            moved(fitted_to(camera, long_side), self.normalized_from_world) for camera in cameras
        ]


FORWARD_FACING_MAX_ANGLE_DEG = 50.0  # beyond, one perspective frame no longer holds all views
FORWARD_FACING_MIN_CLEARANCE = 1.05  # nearest points over the foremost camera's depth
LEAST_POINTS = 16  # along an axis of the grid, whatever the bound on all


def decide_scene_model(
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
    config: SceneModelConfig,
) -> SceneModel:
    """Returns the model of a scene.

    Forward-facing (NDC) when all cameras look within 50 degrees of their mean direction and the
    near points lie in front of every camera; otherwise a box around the points.

    Raises:
        InputError: There are too few points to see where the scene is.
    """
    if len(points_world) < 16:
        raise InputError(
            "sparse points",
            f"only {len(points_world)} points were reconstructed, too few to place the scene",
            "Take more overlapping photographs of textured surfaces",
        )
    frame = _mean_frame(cameras)
    angle_deg, clearance = _forward_facing_evidence(frame, cameras, points_world)
    forward = (
        angle_deg <= FORWARD_FACING_MAX_ANGLE_DEG and clearance >= FORWARD_FACING_MIN_CLEARANCE
    )
    kind = config.space if config.space != "auto" else ("ndc" if forward else "box")
    evidence = {
        "space": {
            "chosen": kind,
            "by": "evidence" if config.space == "auto" else "setting",
            "largest_angle_to_mean_view_deg": angle_deg,
            "angle_threshold_deg": FORWARD_FACING_MAX_ANGLE_DEG,
            "near_point_clearance": clearance,
            "clearance_threshold": FORWARD_FACING_MIN_CLEARANCE,
        }
    }
    decide = _ndc if kind == "ndc" else _box
    return decide(frame, cameras, points_world, config, evidence)


def write_scene_model(path: Path, model: SceneModel) -> None:
    """Writes `scene.json`."""
    text = json.dumps(asdict(model), default=_plain, indent=1, sort_keys=True)
    path.write_text(text + "\n")


def read_scene_model(path: Path) -> SceneModel:
    """Returns the model in `scene.json`."""
    values = json.loads(path.read_text())
    space = values.pop("space")
    space["grid_from_world"] = np.array(space["grid_from_world"])
    space["axis_lengths"] = tuple(space["axis_lengths"])
    values["normalized_from_world"] = np.array(values["normalized_from_world"])
    values["resolution"] = tuple(values["resolution"])
    values["focus"] = tuple(values["focus"])
    return SceneModel(space=Space(**space), **values)


def _plain(value: Any) -> Any:
    return value.tolist()


def _mean_frame(cameras: Sequence[Camera]) -> Float[np.ndarray, "4 4"]:
    """Returns frame_from_world: a rigid frame at the mean centre, z the mean view, y mean down."""
    forward = np.mean([camera.forward_world for camera in cameras], axis=0)
    down = np.mean([camera.world_from_camera[:, 1] for camera in cameras], axis=0)
    if np.linalg.norm(forward) < 1e-3:  # looking all ways: any direction square to down will do
        forward = np.cross(down, cameras[0].world_from_camera[:, 0])
    z = forward / np.linalg.norm(forward)
    y = down - (down @ z) * z
    if np.linalg.norm(y) < 1e-6:
        y = np.cross(z, cameras[0].world_from_camera[:, 0])
    y /= np.linalg.norm(y)
    rotation = np.stack([np.cross(y, z), y, z])
    center = np.mean([camera.center_world for camera in cameras], axis=0)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, -rotation @ center
    return frame


def _apply(
    matrix: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points 3"]:
    result: Float[np.ndarray, "points 3"] = points @ matrix[:3, :3].T + matrix[:3, 3]
    return result


def _forward_facing_evidence(
    frame: Float[np.ndarray, "4 4"],
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
) -> tuple[float, float]:
    """Returns the largest angle to the mean view and how far the points keep off the cameras.

    The clearance is (nearest point depth - rearmost camera) over (foremost - rearmost camera), so
    1 is a point beside the foremost camera.
    """
    cosines = [frame[2, :3] @ camera.forward_world for camera in cameras]
    angle = float(np.degrees(np.arccos(np.clip(min(cosines), -1, 1))))
    centers = _apply(frame, np.stack([camera.center_world for camera in cameras]))
    near = np.percentile(_apply(frame, points_world)[:, 2], 1)
    rear, fore = centers[:, 2].min(), centers[:, 2].max()
    extent = max(fore - rear, 1e-9 * max(abs(near), 1e-300))
    return angle, float(np.clip((near - rear) / extent, -1e6, 1e6))


def _ndc(
    frame: Float[np.ndarray, "4 4"],
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
    config: SceneModelConfig,
    evidence: dict[str, Any],
) -> SceneModel:
    """NDC: an off-centre frustum that holds every view from near to (almost) infinity."""
    depths = _apply(frame, points_world)[:, 2]
    near = 0.9 * float(np.percentile(depths[depths > 0], 0.5))
    normalized_from_world = np.diag([1 / near, 1 / near, 1 / near, 1.0]) @ frame
    views = [moved(fitted_to(c, config.image_long_side), normalized_from_world) for c in cameras]
    fore = max(float(camera.center_world[2]) for camera in views)
    plane = max(0.9, 1.02 * fore)  # in units of the near points' depth, in front of all cameras
    far = 1000.0
    lower, upper = _tangent_bounds(views, (1.0, far))
    space = Space("ndc", _frustum(lower, upper, plane, far), (1.0, 1.0, 1.0), 1e-3)
    depths_normalized = depths / near
    extent = np.ptp([camera.center_world for camera in views], axis=0)[:2].max()
    disparity_px = views[0].fx * extent * (1 / plane - 1 / np.percentile(depths_normalized, 99))
    focal = np.array([views[0].fx, views[0].fy])
    wanted = (*(config.oversampling * focal * (upper - lower)), 0.5 * disparity_px)
    evidence["near_far"] = {
        "nearest_points_world": near / 0.9,
        "plane_normalized": plane,
        "farthest_points_normalized": float(np.percentile(depths_normalized, 99.5)),
        "disparity_range_px": float(disparity_px),
    }
    focus = (0.0, 0.0, float(1 / np.mean(1 / depths_normalized[depths_normalized > plane])))
    return _sized(space, normalized_from_world, wanted, views[0], focus, config, evidence)


def _tangent_bounds(
    views: Sequence[Camera], depths: tuple[float, float]
) -> tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]]:
    """Returns the extremes of x/z and y/z over the corners of all views at the given depths."""
    tangents = []
    for camera in views:
        for x in (0, camera.width):
            for y in (0, camera.height):
                ray = np.array([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1])
                direction = camera.world_from_camera[:, :3] @ ray
                for depth in depths:
                    point = camera.center_world + depth / max(direction[2], 0.1) * direction
                    tangents.append(point[:2] / max(point[2], 1e-3))
    return np.min(tangents, axis=0), np.max(tangents, axis=0)


def _frustum(
    lower: Float[np.ndarray, " 2"], upper: Float[np.ndarray, " 2"], near: float, far: float
) -> Float[np.ndarray, "4 4"]:
    """The projective map of an off-centre frustum along +z to [-1, 1]^3, near at -1."""
    matrix = np.zeros((4, 4))
    for axis in range(2):
        matrix[axis, axis] = 2 / (upper[axis] - lower[axis])
        matrix[axis, 2] = -(upper[axis] + lower[axis]) / (upper[axis] - lower[axis])
    matrix[2, 2] = (far + near) / (far - near)
    matrix[2, 3] = -2 * far * near / (far - near)
    matrix[3, 2] = 1.0
    return matrix


def _box(
    frame: Float[np.ndarray, "4 4"],
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
    config: SceneModelConfig,
    evidence: dict[str, Any],
) -> SceneModel:
    """A box around the points that several views see, scaled so that its longest half is 1."""
    points = _apply(frame, points_world)
    lower, upper = np.percentile(points, 1, axis=0), np.percentile(points, 99, axis=0)
    center, half = (lower + upper) / 2, 1.15 * (upper - lower) / 2
    half = np.maximum(half, 0.02 * half.max())
    scale = 1 / half.max()
    normalized_from_frame = np.diag([scale, scale, scale, 1.0])
    normalized_from_frame[:3, 3] = -scale * center
    normalized_from_world = normalized_from_frame @ frame
    half = half * scale
    grid_from_world = np.diag([*(1 / half), 1.0])
    space = Space("box", grid_from_world, (float(half[0]), float(half[1]), float(half[2])), 0.02)
    views = [moved(fitted_to(c, config.image_long_side), normalized_from_world) for c in cameras]
    pixel = _pixel_footprint(views, _apply(normalized_from_world, points_world))
    wanted = tuple(config.oversampling * 2 * half / pixel)
    evidence["box"] = {"pixel_footprint_normalized": pixel, "half_extent": half.tolist()}
    focus = nearest_to_axes(views)
    return _sized(space, normalized_from_world, wanted, views[0], focus, config, evidence)


def nearest_to_axes(cameras: Sequence[Camera]) -> tuple[float, float, float]:
    """Returns the point with the least squared distance to all optical axes."""
    normal, right = 1e-6 * np.eye(3), np.zeros(3)
    for camera in cameras:
        across = np.eye(3) - np.outer(camera.forward_world, camera.forward_world)
        normal += across
        right += across @ camera.center_world
    x, y, z = np.linalg.solve(normal, right)
    return float(x), float(y), float(z)


def _pixel_footprint(views: Sequence[Camera], points: Float[np.ndarray, "points 3"]) -> float:
    """Returns the median size of a pixel at the points it may see."""
    sizes = []
    for camera in views:
        pixels, depth = project(camera, points)
        size = np.array([camera.width, camera.height])
        inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels < size).all(axis=1)
        sizes.append(depth[inside] / camera.fx)
    return float(np.median(np.concatenate(sizes)))


def _sized(
    space: Space,
    normalized_from_world: Float[np.ndarray, "4 4"],
    wanted: Sequence[float],
    view: Camera,
    focus: tuple[float, float, float],
    config: SceneModelConfig,
    evidence: dict[str, Any],
) -> SceneModel:
    """Returns the model with the wanted resolution brought under the bound on voxels."""
    wanted_points = np.maximum(np.asarray(wanted, dtype=float), LEAST_POINTS)
    points = _bounded(wanted_points, config.max_voxels)
    nx, ny, nz = (round(float(n)) for n in points)
    evidence["resolution"] = {
        "wanted": [float(n) for n in wanted_points],
        "shrunk_by": float((points.prod() / wanted_points.prod()) ** (1 / 3)),
        "max_voxels": config.max_voxels,
    }
    return SceneModel(
        space, normalized_from_world, (nx, ny, nz), view.width, view.height, focus, evidence
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
