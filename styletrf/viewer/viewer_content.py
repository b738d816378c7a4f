"""All that the viewer of a scene shows, gathered from its fields and cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
from styletrf.viewer.visibility import Views, visible_voxels

RENDER = RenderConfig(termination=1e-2, min_weight=1e-2)
"""Of the viewer: what weighs less is not seen (docs/knobs.md)."""


@dataclass(frozen=True, slots=True)
class ViewerContent:
    """What the page shows.

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
    field, bounds = load(), camera_bounds(photographed, path)
    views = Views(model.space, [*photographed, *path], RENDER, bounds.radius)
    density, visible = bake_density(field, views, most_bricks), visible_voxels(field, views)
    looks = [bake_look(name, field, views, visible, RefitConfig(), most_bricks)]
    for style, load_stylized in others:
        progress(len(looks), len(fields))
        stylized = load_stylized()
        require_shared_density(style, stylized, field)
        looks.append(bake_look(style, stylized, views, visible, RefitConfig(), most_bricks))
    progress(len(looks), len(fields))
    return ViewerContent(
        scene, model.space.within(field.bounds), field.step_length, RENDER, density, looks, path,
        bounds, model.focus, model.looking,
    )  # fmt: skip
