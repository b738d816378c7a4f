"""The viewer of the mini scene, served as `styletrf view` serves it."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from shared_browser import close_browsers

TOKEN = "a-token-that-nobody-guesses"


@dataclass(frozen=True)
class Served:
    """A server that runs, what it shows, where it saves, and what bakes one more style."""

    server: Any
    live: Any
    file: Path
    more: Callable[[], tuple[Any, str]]
    scene: Any

    @property
    def port(self) -> int:
        return self.server.server_address[1]


@pytest.fixture(autouse=True, scope="module")
def _browsers() -> Iterator[None]:
    """What a file's tests share of browsers ends with it."""
    yield
    close_browsers()


@pytest.fixture(scope="session")
def baked(stage_of: Callable[..., Any]) -> tuple[Any, Any, Any, dict[str, Path]]:
    """The scene, its content with the photographs, what bakes styles, and the artifacts."""
    from styletrf.field.radiance_field import load_field
    from styletrf.viewer.viewed_scene import read_viewed_scene
    from styletrf.viewer.viewer_content import bake_scene

    inputs = stage_of("Viewer")[1]
    scene, field = read_viewed_scene(inputs), load_field(inputs["field"])
    named = ("Photographs", field)
    content, baking = bake_scene("mini", scene.model, named, scene.photographed, scene.path)
    return scene, content, baking, inputs


@pytest.fixture
def served(baked: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    """The scene with its photographs alone, on pages whose pictures are small: quick ones."""
    from styletrf.field.radiance_field import load_stylized_field
    from styletrf.viewer.viewed_scene import thumbnail
    from tasks.view.live_viewer import LiveViewer
    from tasks.view.page_server import PageServer
    from tasks.view.path_command import path_command

    scene, content, baking, inputs = baked
    file = tmp_path / "out" / "mini" / "camera-path.json"

    def command(weights: dict[str, float], seconds: float) -> str:
        return path_command(file, seconds, weights, ["--scene", "mini"], "p")

    def more() -> tuple[Any, str]:
        field = load_stylized_field(inputs["field"], inputs["stylized p"])
        return baking.baked("p", field), thumbnail(inputs["style p"] / "style.png")

    monkeypatch.setattr("styletrf.viewer.webpage.packed_scene._MOST_PIXELS_WIDE", 160)
    live = LiveViewer(content, [scene.thumbnail], scene.frames_per_second, file, command)
    with PageServer("127.0.0.1", 0, TOKEN) as server:
        server.site = live
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        yield Served(server, live, file, more, scene)
        server.shutdown()
        thread.join()
