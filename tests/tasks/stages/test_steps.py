"""The steps that stages call: all have one form, and docs/library.md lists them."""

import ast
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pytest
import torch
from captures import forward_cameras
from expected_errors import rejects

import tasks
from pipeline.shared_store.checkpoints import CheckpointUploader
from pipeline.shared_store.remote import Remote
from styletrf.files.float_images import write_float_image
from styletrf.files.images import read_rgb, write_rgb
from styletrf.geometry.camera_table import write_cameras
from styletrf.steps.camera_poses import solve_poses
from styletrf.steps.step_run import StepRun
from styletrf.steps.stylized_frames import Blend, stylized_frames
from styletrf.steps.stylized_priors import stylize_priors
from styletrf.style.style_network import (
    StyleNetwork,
    StyleNetworkConfig,
    load_style_network,
    save_style_network,
    stylize,
)

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "docs/library.md").read_text(encoding="utf-8")
FORM = {
    "inputs": Mapping[str, Path],
    "out": Path,
    "settings": Mapping[str, Any],
    "run": StepRun,
}
WITHOUT_A_STEP = {"Grid", "StylizedTrajectory", "TradeOff"}
"""They read records of the store."""


def imported_steps(text: str) -> Iterator[FunctionType]:
    """The functions of styletrf/steps that functions of a module import."""
    functions = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef)]
    for node in (node for function in functions for node in function.body):
        if isinstance(node, ast.ImportFrom) and f"{node.module}".startswith("styletrf.steps."):
            found = [getattr(importlib.import_module(node.module), a.name) for a in node.names]
            yield from filter(inspect.isfunction, found)


FILES = [*(ROOT / "tasks/stages").glob("*.py"), *(ROOT / "tasks/results").glob("*.py")]
STEPS = {s.__name__: s for f in FILES for s in imported_steps(f.read_text(encoding="utf-8"))}


@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS)
def test_every_step_has_the_same_parameters_and_keywords_of_its_own(step: FunctionType):
    signature = inspect.signature(step)
    given = [*signature.parameters.values()]
    assert {p.name: p.annotation for p in given[: len(FORM)]} == FORM
    assert [p.name for p in given[: len(FORM)]] == list(FORM)
    assert all(p.kind is p.KEYWORD_ONLY for p in given[len(FORM) :])
    assert signature.return_annotation is None


@pytest.mark.parametrize("family", sorted({*tasks.__all__} - WITHOUT_A_STEP - {"StyleNetwork"}))
def test_a_build_ends_with_the_one_call_of_a_step(family: str):
    text = textwrap.dedent(inspect.getsource(getattr(tasks, family).build))
    (build,) = ast.parse(text).body
    called = [ast.unparse(n.func) for n in ast.walk(build) if isinstance(n, ast.Call)]
    (step,) = (name for name in called if name in STEPS)
    call = build.body[-1].value
    assert ast.unparse(call.func) == step
    inputs, out, _, run = map(ast.unparse, call.args)
    assert (inputs, out, run) == ("inputs", "out", "self.step_run(run)")


def test_the_page_of_the_library_lists_every_step():
    rows = re.findall(r"^\| `(\w+)` in `(styletrf/steps/\S+)\.py` \|", TEXT, re.MULTILINE)
    assert {name: module.replace("/", ".") for name, module in rows} == {
        name: step.__module__ for name, step in STEPS.items()
    }


def test_the_example_of_the_library_fits_a_field(mini_poses: Path, tmp_path: Path):
    (example,) = re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
    small = '"iterations": 30, "batch": 64, "initial_voxels": 512, "field.hidden": 8'
    example = example.replace('"image_long_side": 480', '"image_long_side": 16, "max_voxels": 4096')
    example = example.replace('"iterations": 500', small)
    folders = {name: tmp_path / name for name in ("model", "field", "work")}
    for folder in folders.values():
        folder.mkdir()
    exec(example, {"poses": mini_poses, **folders})
    assert len(list(folders["work"].iterdir())) == 2  # no step has the checkpoint of another
    assert {path.name for path in folders["field"].iterdir()} == {
        "appearance.safetensors", "curve.parquet", "density.safetensors", "field.json",
    }  # fmt: skip


def test_an_optimization_that_starts_from_a_network_needs_one(mini, tmp_path: Path):
    """It failed at the first view, after the weights had been read. Here no weights exist."""
    inputs = {"priors": mini("PriorRenders"), "style": mini("StyleImage"), "perceptual": tmp_path}
    with rejects("setting 'start'", "'network'", remedy=["'noise'"]):
        stylize_priors(inputs, tmp_path, {}, StepRun(tmp_path), colors="style", factors=(1.0, 1.0))


CAMERAS = forward_cameras(2)


def written_views(folder: Path, color: Any, opacity: Any, painting: Any) -> dict[str, Path]:
    """The folders of two views, which are also a trajectory, of a small network and a painting."""
    network = StyleNetwork(StyleNetworkConfig(2, 1), torch.Generator().manual_seed(0))
    inputs = {name: folder / name for name in ("priors", "network", "style")}
    for path in (inputs["priors"] / "frames", inputs["network"], inputs["style"]):
        path.mkdir(parents=True)
    save_style_network(network, inputs["network"])
    write_cameras(inputs["priors"] / "cameras.parquet", CAMERAS)
    for camera in CAMERAS:
        path = inputs["priors"] / "frames" / f"{camera.name}.exr"
        write_float_image(path, color, opacity, np.ones_like(opacity), half=False)
    write_rgb(inputs["style"] / "style.png", painting)
    return inputs | {"trajectory": inputs["priors"]}


def test_an_object_on_an_empty_ground_gets_the_mean_color_of_the_painting(tmp_path: Path):
    """The map of colors was mostly that of the ground, which is put back afterwards."""
    random, opacity = np.random.default_rng(0), np.zeros((40, 60), np.float32)
    opacity[10:30, 20:40] = 1
    color = np.ones((40, 60, 3), np.float32)
    color[opacity > 0] = random.uniform(0.0, 0.4, (400, 3)) * [1.0, 0.6, 0.3]
    painting = random.uniform(0.35, 0.65, (64, 64, 3)).astype(np.float32)
    inputs, wanted = written_views(tmp_path, color, opacity, painting), painting.mean(axis=(0, 1))
    (out := tmp_path / "out").mkdir()
    stylize_priors(inputs, out, {}, StepRun(tmp_path, "cpu"), colors="style", factors=())
    priors = [read_rgb(out / "frames" / f"{camera.name}.png") for camera in CAMERAS]
    frames = stylized_frames(inputs, CAMERAS, {}, Blend(1.0, {}, {}), "cpu")
    for image in (*priors, *frames):
        np.testing.assert_allclose(image[opacity > 0].mean(axis=0), wanted, atol=1 / 255)
        np.testing.assert_allclose(image[opacity == 0], 1)


def test_without_a_painting_views_keep_the_colors_of_the_network(tmp_path: Path):
    color = np.random.default_rng(0).random((40, 60, 3), np.float32)
    ones = np.ones((40, 60), np.float32)
    inputs = written_views(tmp_path, color, ones, color[::-1] ** 3)
    style, network = inputs.pop("style"), load_style_network(inputs["network"])
    painted = stylize(network, torch.from_numpy(color)).numpy()
    for given, are_kept in (({}, True), ({"style": style}, False)):
        out = tmp_path / f"kept {are_kept}"
        out.mkdir()
        run = StepRun(tmp_path, "cpu")
        stylize_priors(inputs | given, out, {}, run, colors="style", factors=())
        for camera in CAMERAS:
            shown = read_rgb(out / "frames" / f"{camera.name}.png")
            assert (np.abs(shown - painted).max() < 0.51 / 255) == are_kept


@pytest.mark.parametrize(("factors", "missing"), [((), "network"), ((1.0, 1.0), "perceptual")])
def test_priors_without_a_stylizer_are_refused(mini, tmp_path: Path, factors, missing):
    inputs = {"priors": mini("PriorRenders"), "style": mini("StyleImage")}
    with pytest.raises(ValueError, match=f"no '{missing}'"):
        stylize_priors(inputs, tmp_path, {}, StepRun(tmp_path), colors="style", factors=factors)


def test_scratch_files_of_a_killed_search_for_poses_are_no_checkpoint(tmp_path, monkeypatch):
    """Nothing continues from them, but their time counted, and they were uploaded."""
    (work := tmp_path / "work").mkdir()
    (remote := tmp_path / "shared").mkdir()

    def killed(*words):
        (words[-1] / "database.db").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr("styletrf.steps.camera_poses.solve_camera_poses", killed)
    with pytest.raises(KeyboardInterrupt):
        solve_poses({"capture": tmp_path}, tmp_path, {}, StepRun(work))
    assert list(work.rglob("*.db"))
    CheckpointUploader("key", work, Remote(str(remote))).upload()
    assert list(remote.iterdir()) == []
