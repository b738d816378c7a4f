"""Small fields of the courtyard, and what the viewer shows of them."""

from collections.abc import Callable
from functools import cache

import pytest
from tiny_scene import TinyScene, tiny_scene


@pytest.fixture(scope="session")
def tiny() -> Callable[[str], TinyScene]:
    """Returns the scene in a space, made once."""
    return tiny_scene


@pytest.fixture(scope="session")
def content(tiny) -> Callable[[str], object]:
    """Returns what the viewer of the scene in a space shows, baked once."""
    from styletrf.viewer.viewer_content import viewer_content

    @cache
    def baked(space: str) -> object:
        scene = tiny(space)
        loads = [(name, lambda field=field: field) for name, field in scene.fields.items()]
        return viewer_content("the yard", scene.model, loads, scene.cameras, scene.cameras[:5])

    return baked
