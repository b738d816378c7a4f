"""All that the viewer of a scene shows, gathered from its fields and cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from styletrf.field.radiance_field import RadianceField
from styletrf.field.rendering import RenderConfig
from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space
from styletrf.progress import Progress, silent
from styletrf.scene.scene_model import SceneModel
from styletrf.viewer.baking import (
    BakedDensity,
    BakedLook,
    bake_density,
    bake_look,
    require_shared_density,
)
from styletrf.viewer.camera_bounds import CameraBounds, camera_bounds
from styletrf.viewer.color_refit import RefitConfig
from styletrf.viewer.lattice import MOST_BRICKS
from styletrf.viewer.seen_points import Resolution, SeenPoints
from styletrf.viewer.visibility import Views, seen_voxels

RENDER = RenderConfig(termination=1e-2, min_weight=1e-2)
"""Of the viewer: what weighs less is not seen (docs/knobs.md)."""


@dataclass(frozen=True, slots=True)
class ViewerContent:
    """The content of the viewer's page.

    Attributes:
        scene: Its name.
        space: Of the field's grid, see `Space.within`.
        step_length: Of the march.
        render: Of which termination and least weight count.
        density: That all looks share.
        looks: Of the photographs first, then of the paintings.
        path: The fly-through.
        bounds: Where the camera may go.
        focus: What it turns about, in the normalized world.
        looking: How the photographers did, see `SceneModel`.
        world_from_normalized: Leads to the capture's world, which camera paths are in.
    """

    scene: str
    space: Space
    step_length: float
    render: RenderConfig
    density: BakedDensity
    looks: Sequence[BakedLook]
    path: Sequence[Camera]
    bounds: CameraBounds
    focus: tuple[float, float, float]
    looking: str
    world_from_normalized: Float[np.ndarray, "4 4"]


@dataclass(frozen=True, slots=True)
class LookBaking:
    """The field, views and points with which all looks of a scene are baked.

    Attributes:
        field: Of the photographs, whose density all share.
        views: That see it.
        seen: The points that have colors.
    """

    field: RadianceField
    views: Views
    seen: SeenPoints

    def baked(self, name: str, field: RadianceField) -> BakedLook:
        """Returns the colors of a field.

        Raises:
            InputError: It has a density of its own.
        """
        require_shared_density(name, field, self.field)
        return bake_look(name, field, self.views, self.seen, RefitConfig())


def viewer_content(
    scene: str,
    model: SceneModel,
    fields: Sequence[tuple[str, Callable[[], RadianceField]]],
    photographed: Sequence[Camera],
    path: Sequence[Camera],
    progress: Progress = silent,
    most_bricks: int = MOST_BRICKS,
) -> ViewerContent:
    """Bakes a scene's fields.

    Args:
        scene: Its name.
        model: Its space and focus.
        fields: Names, and what loads the fields, one at a time: that of the photographs first,
            whose density all share.
        photographed: The photographs' cameras, in the normalized world.
        path: The fly-through, in the normalized world.
        progress: Called after every field.
        most_bricks: Of each lattice.

    Raises:
        InputError: A field has a density of its own.
    """
    (name, load), *others = fields
    of_paintings = others[0][1]().appearance.factors.resolution if others else None
    content, baking = bake_scene(
        scene, model, (name, load()), photographed, path, most_bricks, of_paintings
    )
    looks = list(content.looks)
    for style, load_stylized in others:
        progress(len(looks), len(fields))
        looks.append(baking.baked(style, load_stylized()))
    progress(len(looks), len(fields))
    return replace(content, looks=looks)


def bake_scene(
    scene: str,
    model: SceneModel,
    photographs: tuple[str, RadianceField],
    photographed: Sequence[Camera],
    path: Sequence[Camera],
    most_bricks: int = MOST_BRICKS,
    of_paintings: Resolution | None = None,
) -> tuple[ViewerContent, LookBaking]:
    """Returns the scene with the look of the photographs alone, and what bakes further looks.

    Args:
        scene: Its name.
        model: Its space and focus.
        photographs: The name of that look, and its field.
        photographed: The photographs' cameras, in the normalized world.
        path: The fly-through, in the normalized world.
        most_bricks: Of each lattice.
        of_paintings: The points of further looks' lattices, None if they are not known.
    """
    name, field = photographs
    bounds = camera_bounds(photographed, path)
    views = Views(model.space, [*photographed, *path], RENDER, bounds.radius)
    density = bake_density(field, views, most_bricks)
    seen = SeenPoints(seen_voxels(field, views), most_bricks, of_paintings)
    baking = LookBaking(field, views, seen)
    content = ViewerContent(
        scene, model.space.within(field.bounds), field.step_length, RENDER, density,
        [baking.baked(name, field)], path, bounds, model.focus, model.looking,
        np.linalg.inv(model.normalized_from_world),
    )  # fmt: skip
    return content, baking
