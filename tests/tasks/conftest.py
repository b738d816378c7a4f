"""A 16x16 scene of four views, and every stage built on it once, with tiny settings."""

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from called_functions import functions_called, keep_functions
from memory import folder_in_memory
from shared_results import made_once

from pipeline.execution.fork_server import ForkServer, forked_by
from tasks.command_line import LIBRARIES

SETTINGS: dict[str, dict[str, Any]] = {
    "SceneModel": {"image_long_side": 16, "max_voxels": 16**3},
    "RadianceField": {
        "rate_decay": 0.1,  # so few iterations take larger steps
        "tv_views": 1,
        "iterations": 30,
        "batch": 64,
        "initial_voxels": 8**3,
        "upsample_at": [0.3],
        "occupancy_every": 10,
        "field.density_ranks": [2, 2, 2],
        "field.appearance_ranks": [2, 2, 2],
        "field.features": 4,
        "field.hidden": 8,
    },
    "PriorRenders": {"trajectory.frames": 3, "coverage.count": 3},
    "TrajectoryFrames": {"trajectory.frames": 7},
    "StyleNetwork": {
        "iterations": 2,
        "batch": 1,
        "crop_px": 32,
        "style_px": 64,
    },
    "ContentImages": {"count": 8},
    "StylizedPriors": {"iterations": [2, 1], "style_px": 64},
    "StylizedField": {
        "adaptation.iterations": 10,
        "adaptation.batch": 64,
        "image.iterations": 2,
        "weight_power.powers": [1.0],  # one of all styles, which mixtures need to be exact
        "fit.iterations": 30,
        "fit.batch": 64,
        "fit.initial_voxels": 8**3,
        "style_px": 64,
    },
}


FURTHER_LIBRARIES = ("OpenEXR", "onnx", "pi_heif", "pyarrow.parquet", "torch._dynamo")
"""What many stages import, some for a second: torch's optimizers import the last one."""
STEPS = tuple(
    f"styletrf.steps.{name}"
    for name in ("camera_poses", "radiance_field", "style_network", "stylized_field")
)
"""Code of the project, which stays the same meanwhile. A command's own server imports none of it.

Not `tasks`: when that is first imported, it takes over a bare Luigi.
"""


@pytest.fixture
def tmp_path(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    with folder_in_memory(tmp_path, request.config) as folder:
        yield folder


@pytest.fixture(scope="session")
def server() -> Iterator[ForkServer]:
    """A process that has imported libraries and steps, which starts with the first fork."""
    server = ForkServer([*LIBRARIES, *FURTHER_LIBRARIES, *STEPS])
    yield server
    server.close()


@pytest.fixture(autouse=True, scope="module")
def _forked(server: ForkServer) -> Iterator[None]:
    """Commands and their builds are forked from that process; for users, only builds are."""
    with forked_by(server):
        yield


@pytest.fixture(scope="session")
def mini_poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What CameraPoses leaves: four views of a plane painted with a smooth pattern."""
    import numpy as np

    from styletrf.files.images import write_rgb
    from styletrf.geometry.camera_table import write_cameras
    from styletrf.geometry.cameras import Camera, pixel_centers
    from styletrf.geometry.point_table import SparsePoints, write_points
    from styletrf.trajectory.trajectories import look_at

    folder = tmp_path_factory.mktemp("poses")
    (folder / "images").mkdir()
    target, down = np.array([0.0, 0.0, 4.0]), np.array([0.0, 1.0, 0.0])
    cameras = []
    for k, center in enumerate([(-0.3, -0.2, 0), (0.3, -0.2, 0), (-0.3, 0.2, 0), (0.3, 0.2, 0)]):
        pose = look_at(np.array(center, dtype=float), target, down)
        camera = Camera(f"{k}", 16, 16, 16.0, 16.0, 8.0, 8.0, pose)
        x, y = ((pixel_centers(16, 16) - 8) / 16).T
        directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ pose[:, :3].T
        depth = 4 / directions[:, 2]
        plane = np.array(center) + depth[:, None] * directions
        color = 0.5 + 0.4 * np.sin(plane + np.array([0.0, 1.0, 2.0]))
        write_rgb(folder / "images" / f"{k}.png", color.reshape(16, 16, 3).astype(np.float32))
        cameras.append(camera)
    write_cameras(folder / "cameras.parquet", cameras, held_out={"0"})
    rng = np.random.default_rng(0)
    xyz = np.column_stack([rng.uniform(-2, 2, (100, 2)), rng.uniform(3.8, 4.2, 100)])
    points = SparsePoints(
        xyz, np.zeros((100, 3), np.uint8), np.zeros(100),
        np.arange(100), np.zeros(100, np.int64), np.zeros((100, 2)),
    )  # fmt: skip
    write_points(folder / "points.parquet", points)
    report = {"registered": 4, "total": 4, "unregistered": [], "pieces": [4], "doubts": []}
    report |= {"mapper": "global", "mapper_reason": "they overlap", "tells_depth": True}
    report["photograph_sizes"] = {camera.name: [16, 16] for camera in cameras}
    (folder / "poses.json").write_text(json.dumps(report))
    return folder


@pytest.fixture(scope="session")
def perceptual_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Random weights in the layout of VGG16: the architecture is real, the training is not."""
    import torch
    from safetensors.torch import save_file

    from styletrf.style.perceptual.vgg import VGG16

    path = tmp_path_factory.mktemp("weights") / "random.safetensors"
    torch.manual_seed(0)
    save_file({k: v.contiguous() for k, v in VGG16().state_dict().items()}, path)
    return path


@pytest.fixture(scope="session")
def transfer_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Random weights in the layout of arbitrary style transfer's ONNX files."""
    from onnx_files import write_transfer_files

    return write_transfer_files(tmp_path_factory.mktemp("transfer"))


@pytest.fixture(scope="session")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data root with one scene of eight larger photographs and two paintings."""
    import numpy as np

    from styletrf.files.images import write_rgb

    root = tmp_path_factory.mktemp("data")
    rng = np.random.default_rng(0)
    for folder, names in (("scenes/mini/images", "abcdefgh"), ("styles", "pq")):
        (root / folder).mkdir(parents=True)
        for name in names:
            coarse = rng.random((16, 16, 3)).astype(np.float32)
            write_rgb(
                root / folder / f"{name}.png", np.kron(coarse, np.ones((6, 6, 1), np.float32))
            )
    return root


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Builds one stage from the artifacts given, and returns what it left."""
    from pipeline.task import RunContext

    def built(stage: Any, **inputs: Path) -> Path:
        folder = tmp_path_factory.mktemp(stage.task_family)
        for name in ("out", "resume"):
            (folder / name).mkdir()
        context = RunContext(lambda *_, **__: None, folder / "resume", folder / "log")
        stage.build(inputs, folder / "out", context)
        return folder / "out"

    return built


Graph = tuple[Callable[..., Path], Callable[..., tuple[Any, dict[str, Path]]]]
"""What `mini` and `stage_of` return."""


@pytest.fixture(scope="session")
def mini_graph(
    build: Callable[..., Path],
    mini_poses: Path,
    photographs: Path,
    perceptual_file: Path,
    transfer_folder: Path,
) -> Graph:
    """The stages on the mini scene, each built once for all tests of all workers, when needed."""
    import luigi

    import tasks
    from tasks.machine.calibration import keep_calibration, this_machine
    from tasks.planning.stage_costs import reference_costs
    from tasks.stages.style_parameters import STYLE_AND_PATH_PARAMETERS

    made: dict[tuple[str, str], Path] = {("CameraPoses", "{}"): mini_poses}
    words = {
        "scene": "mini",
        "style": "p",
        "styles": ("p",),
        "quality": "draft",
        "content": "embedded",
        "perceptual": str(perceptual_file),
        "transfer": str(transfer_folder),
        "format": "points",
    }

    def controls_of(task: Any) -> dict[str, Any]:
        names = {*STYLE_AND_PATH_PARAMETERS, "style"} & set(task.get_param_names())
        given = {name: task.param_kwargs[name] for name in names if not task.is_default(name)}
        return {n: v for n, v in given.items() if words.get(n) != v}

    def artifact_of(family: str, **controls: Any) -> Path:
        key = family, json.dumps(controls, sort_keys=True, default=dict)
        if key not in made:
            stage, inputs = with_inputs(family, **controls)
            name = hashlib.sha256("".join(key).encode()).hexdigest()
            is_traced = not controls  # which takes time, and no test needs more
            made[key] = made_once(f"{family} {name}", lambda: built(stage, inputs, is_traced))
        return made[key]

    def built(stage: Any, inputs: dict[str, Path], is_traced: bool) -> Path:
        family = stage.task_family
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("STYLETRF_DATA", str(photographs))
            if family == "SceneReport":  # it would measure this machine
                keep_calibration(this_machine(), reference_costs().calibration.seconds)
            if not is_traced:
                return build(stage, **inputs)
            with functions_called() as names:
                artifact = build(stage, **inputs)
            keep_functions(artifact, names)
            return artifact

    def with_inputs(family: str, **controls: Any) -> tuple[Any, dict[str, Path]]:
        kind: type[luigi.Task] = getattr(tasks, family)
        names = set(kind.get_param_names())
        parameters: dict[str, Any] = {k: v for k, v in words.items() if k in names}
        if "settings" in names:
            parameters["settings"] = SETTINGS.get(family, {}) | controls.pop("settings", {})
        elif "tuning" in names:
            parameters["tuning"] = SETTINGS
        stage = kind(**{**parameters, **controls})
        stage.validate()
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("STYLETRF_DATA", str(photographs))
            return stage, {
                name: artifact_of(task.task_family, **controls_of(task))
                for name, task in stage.requires().items()
            }

    return artifact_of, with_inputs


@pytest.fixture(scope="session")
def mini(mini_graph: Graph) -> Callable[..., Path]:
    """Returns a stage's artifact on the mini scene by family and controls, built once."""
    return mini_graph[0]


@pytest.fixture(scope="session")
def stage_of(mini_graph: tuple[Any, Callable[..., Any]]) -> Callable[..., Any]:
    """Returns a stage on the mini scene by family and controls, and its inputs, built once."""
    return mini_graph[1]


@pytest.fixture
def out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, photographs: Path) -> Path:
    """The folder of results, and the photographs to make them of."""
    monkeypatch.setenv("STYLETRF_OUT", str(tmp_path / "out"))
    monkeypatch.setenv("STYLETRF_DATA", str(photographs))
    return tmp_path / "out"
