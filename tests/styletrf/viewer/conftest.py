"""Small fields of the courtyard, and what the viewer shows of them."""

from collections.abc import Callable, Iterator
from functools import cache

import pytest
from shared_browser import close_browsers
from shared_results import made_once
from tiny_scene import TinyScene, tiny_scene


@pytest.fixture(autouse=True, scope="module")
def _browsers() -> Iterator[None]:
    """What a file's tests share of browsers ends with it."""
    yield
    close_browsers()


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
        of = scene.model, loads, scene.cameras, scene.cameras[:5]
        return made_once(f"viewer of {space}", lambda: viewer_content("the yard", *of))

    return baked
