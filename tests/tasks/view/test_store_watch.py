"""Styles come into an open viewer when their fields are in the store."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import luigi
import pytest
from luigi.task_register import Register
from message_words import mentions

import tasks
from pipeline.task import RunContext
from tasks.stages.stage import Stage
from tasks.view import store_watch
from tasks.view.store_watch import adapted_styles, watch_store

pytestmark = pytest.mark.usefixtures("inline")


class FieldOf(Stage):
    """A field that is made of a painting at once."""

    style, revision = luigi.Parameter(), "1"

    def identity_parameters(self) -> Mapping[str, object]:
        return {}

    def requires(self) -> Mapping[str, Stage]:
        return {"style": tasks.StyleImage(style=self.style)}

    def build(self, inputs: Mapping[str, Path], out: Path, run: RunContext) -> None:
        shutil.copy(inputs["style"] / "style.png", out)


VIEWER: Any = SimpleNamespace(upstream=lambda _stage, style: FieldOf(style=style))


@pytest.fixture
def styles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The empty folder of paintings."""
    monkeypatch.setenv("STYLETRF_DATA", str(tmp_path / "data"))
    folder = tmp_path / "data/styles"
    folder.mkdir(parents=True)
    return folder


def build_elsewhere(style: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Builds a field as another process does, which has instances of its own of all tasks."""
    with monkeypatch.context() as patch:
        patch.setattr(Register, "_Register__instance_cache", {})
        field = FieldOf(style=style)
        for task in (field.requires()["style"], field):
            task.run()


def after_a_poll() -> list[str]:
    """Returns the styles that are found within two polls."""
    adapted_styles(VIEWER)
    return adapted_styles(VIEWER)


def watched(until: Callable[[str], bool]) -> tuple[list[str], str]:
    """Returns the styles that a page gets until that of which this holds, and its last report."""
    shown, stop = [], Event()

    def add(style: str) -> None:
        shown.append(style)
        if until(style):
            stop.set()

    live: Any = SimpleNamespace(add=add, report="")
    watch_store(VIEWER, live, lambda style: (style,), stop)
    return shown, live.report


def test_a_painting_whose_copy_was_under_way_comes_when_its_field_is_made(
    styles: Path, photographs: Path, monkeypatch: pytest.MonkeyPatch
):
    """It was taken for the first half of it until the server ended."""
    whole = (photographs / "styles/p.png").read_bytes()
    (styles / "new.png").write_bytes(whole[: len(whole) // 2])
    assert after_a_poll() == []
    (styles / "new.png").write_bytes(whole)
    assert after_a_poll() == []
    build_elsewhere("new", monkeypatch)
    assert after_a_poll() == ["new"]


def test_a_painting_that_is_replaced_before_its_field_is_made_comes(
    styles: Path, photographs: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in "pq":
        shutil.copy(photographs / f"styles/{name}.png", styles / "new.png")
        with monkeypatch.context() as patch:
            patch.setattr(Register, "_Register__instance_cache", {})
            tasks.StyleImage(style="new").run()
        assert after_a_poll() == []
    build_elsewhere("new", monkeypatch)
    assert after_a_poll() == ["new"]


def test_paintings_that_share_a_name_come_by_their_names_with_suffixes(
    styles: Path, photographs: Path, monkeypatch: pytest.MonkeyPatch
):
    """They never came, since no command takes the name without a suffix."""
    for name in ("new.jpg", "new.png", "other.png"):
        shutil.copy(photographs / "styles/p.png", styles / name)
    assert after_a_poll() == []
    for name in ("new.jpg", "new.png", "other"):
        build_elsewhere(name, monkeypatch)
    assert after_a_poll() == ["new.jpg", "new.png", "other"]


def test_a_painting_named_as_the_photographs_is_reported_and_not_shown(
    styles: Path, photographs: Path, monkeypatch: pytest.MonkeyPatch
):
    """The page had two looks of one name."""
    for name in ("PhotoGraphs", "other"):
        shutil.copy(photographs / "styles/p.png", styles / f"{name}.png")
        build_elsewhere(name, monkeypatch)
    assert adapted_styles(VIEWER) == ["other"]
    shown, report = watched(lambda _style: True)
    assert shown == ["other"]
    assert mentions(report, "PhotoGraphs")


def test_a_shown_painting_does_not_come_again_when_another_of_its_name_does(
    styles: Path, photographs: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(store_watch, "POLL_S", 0.0)
    shutil.copy(photographs / "styles/p.png", styles / "new.jpg")
    build_elsewhere("new", monkeypatch)

    def add_another(style: str) -> bool:
        if style == "new":
            shutil.copy(photographs / "styles/q.png", styles / "new.png")
            build_elsewhere("new.png", monkeypatch)
        return style == "new.png"

    assert watched(add_another)[0] == ["new", "new.png"]
