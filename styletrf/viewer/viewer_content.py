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
"""The settings of the viewer: samples that weigh less are not seen (docs/knobs.md)."""


@dataclass(frozen=True, slots=True)
class ViewerContent:
    """The content of the viewer's page.

    Attributes:
        scene: Its name.
        space: The space of the field's grid, see `Space.within`.
        step_length: The step length of the march.
        render: The settings, of which termination and least weight count.
        density: The density that all looks share.
        looks: The look of the photographs first, then those of the paintings.
        path: The fly-through.
        bounds: Where the camera may go.
        focus: The point that it turns about, in the normalized world.
        looking: How the photographers looked, see `SceneModel`.
        world_from_normalized: The map to the capture's world, in which camera paths are.
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
        field: The field of the photographs, whose density all share.
        views: The views that see it.
        seen: The points that have colors.
    """

    field: RadianceField
    views: Views
    seen: SeenPoints

    def baked(self, name: str, field: RadianceField) -> BakedLook:
        """Returns the colors of a field.

        Raises:
            InputError: The field has a density of its own.
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
        fields: The names and loaders of the fields, one at a time: that of the photographs first,
            whose density all share.
        photographed: The photographs' cameras, in the normalized world.
        path: The fly-through, in the normalized world.
        progress: Called after every field.
        most_bricks: The most bricks of each lattice.

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
    """Returns the scene with the look of the photographs alone, and the baking of further looks.

    Args:
        scene: Its name.
        model: Its space and focus.
        photographs: The name of that look, and its field.
        photographed: The photographs' cameras, in the normalized world.
        path: The fly-through, in the normalized world.
        most_bricks: The most bricks of each lattice.
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
