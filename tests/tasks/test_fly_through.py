"""The command line from photographs to the report, on a small courtyard with tiny settings."""

import html
import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_output import command
from expected_errors import rejects
from luigi.cmdline_parser import CmdlineParser
from message_words import mentions
from shared_daylight import shared_daylight
from viewing import viewing

import tasks
from pipeline.maintenance.garbage_collection import collect
from pipeline.store import Store
from pipeline.task import artifact
from styletrf.files.images import write_rgb
from styletrf.files.video_frames import video_info
from styletrf.geometry.camera_table import read_cameras
from styletrf.synthetic.courtyard.capture import CourtyardConfig
from styletrf.synthetic.courtyard.folder import write_courtyard
from tasks.machine.calibration import keep_calibration, this_machine
from tasks.planning.stage_costs import reference_costs

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
FRAMES, STRAYS = 6, 2
SETTINGS: dict[str, dict[str, Any]] = {
    "SceneModel": {"image_long_side": 24, "max_voxels": 16**3},
    "RadianceField": {
        "iterations": 30,
        "batch": 64,
        "initial_voxels": 8**3,
        "upsample_at": [0.3],
        "occupancy_every": 10,
        "tv_views": 1,
        "field.density_ranks": [2, 2, 2],
        "field.appearance_ranks": [2, 2, 2],
        "field.features": 4,
        "field.hidden": 8,
    },
    "ContentImages": {"count": 8},
    "StyleNetwork": {
        "network.width": 4,
        "network.n_residual": 1,
        "iterations": 2,
        "identity_iterations": 0,
        "batch": 1,
        "crop_px": 32,
        "style_px": 64,
    },
    "PriorRenders": {"trajectory.frames": 3, "coverage.count": 3},
    "TrajectoryFrames": {"trajectory.frames": FRAMES},
    "StylizedField": {
        "adaptation.iterations": 10,
        "adaptation.batch": 64,
        "image.iterations": 2,
        "weight_power.powers": [1.0],
        "style_px": 64,
    },
    "QualityMetrics": {"perceptual_px": 96},
    "StyleMetrics": {"frames": 2},
}
NOT_OF_FRAMES = {"--style", "--strength", "--blend", "--content", "--perceptual"}
OF_THE_STYLE = {
    "StyleImage",
    "StyleNetwork",
    "StylizedPriors",
    "StylizedField",
    "StylizedFrames",
    "ConsistencyMetrics",
    "StyleMetrics",
    "StylizedTrajectory",
}


@dataclass(frozen=True)
class Run:
    """What a command left on the screen."""

    status: int
    report: Path
    screen: str
    seconds: float

    @property
    def started(self) -> list[str]:
        """The families that were built, in order."""
        lines = [line for line in self.screen.splitlines() if line.endswith(": started")]
        return [line.split()[0].removesuffix(":") for line in lines]


@dataclass(frozen=True)
class Workplace:
    """Folders of a user's own, and the command run on them."""

    root: Path
    perceptual: Path

    def environment(self) -> dict[str, str]:
        return {
            f"STYLETRF_{name.upper()}": str(self.root / name) for name in ("data", "store", "out")
        }

    def result(self, style: str) -> list[str]:
        return ["StylizedTrajectory", "--scene", "yard", "--style", style]

    def words(self, *task: str) -> list[str]:
        words = [*task] if "--quality" in task else [*task, "--quality", "draft"]
        words += ["--content", "embedded", "--perceptual", str(self.perceptual), "--device", "cpu"]
        if "--tuning" not in task:
            for family, settings in SETTINGS.items():
                words += [f"--{family}-settings", json.dumps(settings)]
        return words

    def command(self, *task: str) -> Run:
        return self.luigi("--module", "tasks", *self.words(*task))

    @contextmanager
    def task(self, *task: str) -> Iterator[Any]:
        """The task of a command, in this process."""
        with (
            pytest.MonkeyPatch.context() as patch,
            CmdlineParser.global_instance(self.words(*task)) as parser,
        ):
            for name, value in self.environment().items():
                patch.setenv(name, value)
            yield parser.get_task_obj()

    def luigi(self, *words: str) -> Run:
        begun = time.monotonic()
        return run_of(command(*words, **self.environment()), begun)

    def interpreted(self, *words: str) -> Run:
        """A command in an interpreter of its own, which starts another for its builds."""
        begun = time.monotonic()
        process = subprocess.run(
            [sys.executable, "-m", "luigi", *words],
            cwd=ROOT,
            env=os.environ | self.environment(),
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        return run_of(process, begun)

    def videos(self) -> list[Path]:
        """Those that stages left."""
        return [*(self.root / "store/objects").glob("*/*/*.mp4")]


def run_of(process: "subprocess.CompletedProcess[str]", begun: float) -> Run:
    report = Path(process.stdout.strip().splitlines()[-1]) if process.stdout else Path()
    return Run(process.returncode, report, process.stderr, time.monotonic() - begun)


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory, perceptual_file: Path) -> Workplace:
    """Twelve photographs of the courtyard, two of nothing, one of a phone, and two paintings."""
    root = tmp_path_factory.mktemp("workplace")
    with shared_daylight():
        scene = CourtyardConfig(n_views=12, width=200, height=150)
        write_courtyard(root / "data/scenes/yard", scene)
    images = root / "data/scenes/yard/images"
    for k, noise in enumerate(np.random.default_rng(0).random((STRAYS, 150, 200, 3))):
        write_rgb(images / f"stray{k}.png", noise.astype(np.float32))
    (images / "raw.NEF").touch()
    (root / "data/styles").mkdir()
    for name in ("brush", "dots"):
        shutil.copy(ROOT / "data/styles" / f"{name}.jpg", root / "data/styles")
    workplace = Workplace(root, perceptual_file)
    with pytest.MonkeyPatch.context() as patch:  # a sweep would measure this machine
        patch.setenv("STYLETRF_STORE", workplace.environment()["STYLETRF_STORE"])
        keep_calibration(this_machine("cpu"), reference_costs().calibration.seconds)
    return workplace


@pytest.fixture(scope="module")
def first(workplace: Workplace) -> Run:
    """The first run, which builds everything."""
    run = workplace.command(*workplace.result("brush"))
    assert run.status == 0, run.screen
    return run


def test_the_command_makes_everything_and_says_where_it_is(workplace: Workplace, first: Run):
    others = {"Export", "Grid", "SceneReport", "StylizationMetrics", "TradeOff", "Viewer"}
    assert set(first.started) == set(tasks.__all__) - others
    assert len(first.started) == len(set(first.started))
    assert first.report == workplace.root / "out/yard/brush/report.html"
    links = list(first.report.parent.iterdir())
    assert {link.name for link in links} >= {"report.html", "video.mp4", "frames", "priors"}
    assert all(link.exists() for link in links)
    assert "yard/brush/video.mp4" in (workplace.root / "out/index.html").read_text()
    for name in ("video.mp4", "unstylized.mp4"):
        assert video_info(first.report.with_name(name)).frames == FRAMES
    assert len(list(first.report.with_name("frames").iterdir())) == FRAMES


def test_warnings_name_what_is_odd_about_the_photographs(first: Run):
    warnings = [line.split(": warning: ") for line in first.screen.splitlines()]
    of_stages = [(parts[0].split()[0], parts[1]) for parts in warnings if len(parts) > 1]
    capture, poses, *_ = of_stages
    assert (capture[0], poses[0]) == ("SceneCapture", "CameraPoses")
    assert mentions(capture[1], "raw.NEF")
    assert mentions(poses[1], "12 of 14", "stray0, stray1")
    page = first.report.read_text()
    assert mentions(page, "12 of 14", "stray0, stray1")
    assert f"{capture[1][0].upper()}{capture[1][1:]}." in page


@pytest.mark.usefixtures("first")
def test_colmaps_messages_lie_beside_the_log(workplace: Workplace):
    logs = workplace.root / "store/logs/CameraPoses"
    assert {path.suffix for path in logs.iterdir()} == {".log", ".json", ".colmap"}
    assert list(logs.glob("*.colmap/colmap.*"))


def test_what_is_shown_outlives_a_collection(workplace: Workplace, first: Run):
    store = Store.open(workplace.root / "store")
    decisions = collect(store, keep_last=0, grace_hours=0, delete=True)
    assert {decision.why for decision in decisions if not decision.delete} == {"pinned or shown"}
    assert not [
        decision for decision in decisions if decision.delete and decision.what[0].isupper()
    ]
    assert all(link.exists() for link in first.report.parent.iterdir())


@pytest.mark.usefixtures("first")
def test_the_cameras_are_those_of_the_courtyard(workplace: Workplace, monkeypatch):
    for name, value in workplace.environment().items():
        monkeypatch.setenv(name, value)
    poses = artifact(tasks.CameraPoses(scene="yard", quality="draft"))
    truth = {
        Path(camera.name).stem: camera.world_from_camera
        for camera in read_cameras(workplace.root / "data/scenes/yard/truth/cameras.parquet")
    }
    found = {
        camera.name: camera.world_from_camera for camera in read_cameras(poses / "cameras.parquet")
    }
    assert found.keys() == truth.keys()
    ours, theirs = (np.array([poses[name] for name in sorted(truth)]) for poses in (found, truth))
    u, _, vt = np.linalg.svd(np.einsum("nij,nkj->ik", theirs[:, :, :3], ours[:, :, :3]))
    aligned = u @ vt @ ours
    relative = np.einsum("nij,nij->n", theirs[:, :, :3], aligned[:, :, :3])
    angles = np.arccos(np.clip((relative - 1) / 2, -1, 1))
    assert np.degrees(np.median(angles)) < 0.5
    centers, expected = (c - c.mean(axis=0) for c in (aligned[:, :, 3], theirs[:, :, 3]))
    scale = (centers * expected).sum() / (centers**2).sum()
    assert np.abs(scale * centers - expected).max() < 0.02 * np.ptp(expected, axis=0).max()


@pytest.mark.usefixtures("first")
def test_another_style_builds_only_what_depends_on_it_and_comes_into_an_open_viewer(
    workplace: Workplace,
):
    with viewing(workplace.words("yard"), workplace.environment()) as viewer:
        assert viewer.address.startswith("http://127.0.0.1:")  # by default, this machine alone
        assert viewer.looks(2) == ["Photographs", "brush"]
        other = workplace.command(*workplace.result("dots"))
        assert viewer.looks(3) == ["Photographs", "brush", "dots"]
        pose = {"position": [0, 0, 0], "orientation": [1, 0, 0, 0]}
        path = {"key_frames": [pose], "closed": False, "easing": 0}
        request = {"path": path, "seconds": 0.5, "a": 2, "b": 0, "share": 1}
        saved = viewer.asked("path", request)
        assert viewer.interrupted() == 0
    assert Path(saved["file"]) == workplace.root / "out/yard/camera-path.json"
    words = shlex.split(saved["command"])[1:]
    planned = command(*words, "--plan", "--json", **workplace.environment())
    assert planned.returncode == 0, planned.stderr
    missing = [s["family"] for s in json.loads(planned.stdout)["stages"] if s["state"] == "to make"]
    assert missing[0] == "TrajectoryFrames", "the fields are those that the viewer shows"
    given = zip(words[3::2], words[4::2], strict=True)
    along = [word for pair in given if pair[0] not in NOT_OF_FRAMES for word in pair]
    rendered = workplace.interpreted("--module", "tasks", "TrajectoryFrames", *along)
    assert (rendered.status, rendered.started) == (0, ["TrajectoryFrames"]), rendered.screen
    assert 12 in {video_info(file).frames for file in workplace.videos()}
    assert other.status == 0, other.screen
    assert set(other.started) == OF_THE_STYLE
    assert other.report.parent.name == "dots"
    assert other.report.is_file()


@pytest.mark.usefixtures("first")
def test_a_grid_shows_what_it_made_and_why_not_the_rest(workplace: Workplace):
    index = workplace.root / "out/index.html"
    index.unlink()
    scenes, styles = '["yard", "nowhere"]', '["brush", "none"]'
    grid = workplace.command("Grid", "--scenes", scenes, "--styles", styles, "--keep-going")
    assert (grid.status, grid.report, set(grid.started)) == (31, index, set())
    text = index.read_text()
    assert mentions(text, "3 failed")
    assert "SceneCapture" in (index.parent / "nowhere/lineage.html").read_text()
    assert html.escape("'none'") in text
    assert 'href="yard/brush/report.html"' in text
    summary = json.loads((workplace.root / "out/grid.json").read_text())
    outcomes = {(c["scene"], c["style"]): (c["outcome"], c["reason"]) for c in summary["cells"]}
    assert outcomes["yard", "brush"] == ("found", "")
    assert mentions(outcomes["yard", "none"][1], "StyleImage", "'none'")
    assert mentions(outcomes["nowhere", "brush"][1], "SceneCapture", "'nowhere'")
    assert mentions(grid.screen, "4 cells", "1 found", "3 failed")


@pytest.mark.usefixtures("first")
def test_a_viewer_is_made_of_the_same_field_and_the_index_opens_it(workplace: Workplace):
    viewer = workplace.command("Viewer", "--scene", "yard", "--styles", '["brush"]')
    assert (viewer.status, viewer.started) == (0, ["Viewer"]), viewer.screen
    out = workplace.root / "out"
    assert viewer.report == out / "yard/viewer.html"
    assert "yard/viewer.html#style=brush" in (out / "index.html").read_text()
    assert (out / "yard/viewer.brush.jpg").is_file(), "by which the report finds it"
    lineage = (out / "yard/lineage.html").read_text()
    for family in ("CameraPoses", "StylizedField", "StylizedTrajectory", "Viewer"):
        assert f"<span>{family}</span>" in lineage


def test_the_same_again_builds_nothing_and_deleted_links_come_back(
    workplace: Workplace, first: Run
):
    links = {path.name: path.resolve() for path in first.report.parent.iterdir()}
    shutil.rmtree(workplace.root / "out")
    again = workplace.command(*workplace.result("brush"))
    assert (again.status, again.report, again.started) == (0, first.report, [])
    assert again.seconds < 15
    assert {path.name: path.resolve() for path in first.report.parent.iterdir()} == links


@pytest.mark.usefixtures("first")
def test_a_sweep_measures_its_variants_alone_and_its_front_serves_requests(workplace: Workplace):
    """What the usual result needs is there; a killed sweep would go on likewise."""
    changes = ["faint samples of the fit x 3", "adaptation iterations x 0.5"]
    words = ["TradeOff", "--scene", "yard", "--style", "brush", "--repeats", "1"]
    words += ["--only", json.dumps(changes)]
    with workplace.task(*words) as task, rejects("settings", remedy=["--tuning"]) as refused:
        task.validate()
    assert mentions(refused.value.subject, *SETTINGS)
    tuning = {**SETTINGS, "StylizationMetrics": {"style_px": 64}}
    sweep = workplace.command(*words, "--tuning", json.dumps(tuning))
    assert sweep.status == 0, sweep.screen
    assert Counter(sweep.started) == {
        "RadianceField": 1, "QualityMetrics": 1, "TrajectoryFrames": 1,  # of the fit
        "StylizedField": 1, "StylizedFrames": 1, "StylizationMetrics": 2,  # of the adaptation
        "StyleMetrics": 1, "ConsistencyMetrics": 1,
        "TradeOff": 1,
    }  # fmt: skip
    assert sweep.report == workplace.root / "out/yard/trade-off/report.html"
    front = json.loads(sweep.report.with_name("front.json").read_text())
    assert 1 <= len(front["points"]) <= 4
    assert all("RadianceField" in point["combination"]["tuning"] for point in front["points"])
    request = [*workplace.result("brush"), "--quality", "within 99 dB"]
    with workplace.task(*request) as task, rejects("settings") as refused:
        task.validate()
    assert mentions(refused.value.subject, *SETTINGS)
    request += ["--tuning", "{}"]
    resolved = workplace.command(*request)
    assert resolved.status == 0, resolved.screen
    assert "RadianceField" not in resolved.started, "the sweep fitted those of all points"
    of_the_front = (front[name] for name in ("scene", "style", "measured", "machine"))
    assert mentions(resolved.screen, *of_the_front)
    assert resolved.report == workplace.root / "out/yard/brush/report.html"
    with workplace.task(*request) as task:
        assert task.complete(), "the same again builds nothing"
