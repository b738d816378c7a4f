"""The code of the real graph: what an edit changes, and whether the closures are whole."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from called_functions import functions_called_for
from message_words import mentions

import tasks
from pipeline.code.adoption import snapshot_of
from pipeline.code.closure import code_closure
from pipeline.code.snapshot import Snapshot
from pipeline.code.source import dotted_names, imports_in, read
from pipeline.maintenance.code_commands import families
from pipeline.settings import current_store

ROOT = Path(__file__).parents[2]
SERVER = """
import contextlib, gc, io, json, sys
from pipeline.code.snapshot import code_in_key, present_code
from pipeline.maintenance.code_commands import families
from pipeline.maintenance.command_line import main
gc.disable()  # syntax trees are many and stay
for line in sys.stdin:
    if words := json.loads(line):
        with contextlib.redirect_stdout(io.StringIO()):
            main(words)
    tasks = families("tasks")
    codes = {t.task_family: code_in_key(t.task_family, present_code(t, t.revision)) for t in tasks}
    print(json.dumps(codes), flush=True)
"""


class Workbench:
    """A copy of the project to edit, and a process that runs commands and reads code there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("pipeline", "styletrf", "tasks"):
            shutil.copytree(
                ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__")
            )
        # Beside the packages: a snapshot in one would make all closures be followed again.
        (folder / "tasks/identity.json").rename(folder / "identity.json")
        settings = (ROOT / "luigi.cfg").read_text()
        beside = settings.replace("[store]", "[store]\nidentity = identity.json")
        (folder / "luigi.cfg").write_text(beside)
        self.process = subprocess.Popen(
            [sys.executable, "-c", SERVER],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.before = self.codes("snapshot")
        files = (path for path in folder.rglob("*.*") if "__pycache__" not in path.parts)
        self.untouched = {path: path.read_bytes() for path in files if path.is_file()}

    def codes(self, *command: str) -> dict[str, str]:
        """The code in the keys of the families, after a command of `python -m pipeline`."""
        self.process.stdin.write(f"{json.dumps(command)}\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def changed(self, *command: str) -> set[str]:
        """The families whose keys the edits so far alter, after a command."""
        now = self.codes(*command)
        assert now.keys() == self.before.keys()
        return {family for family, code in now.items() if code != self.before[family]}

    def edit(self, file: str, pattern: str, replacement: str) -> None:
        path = self.folder / file
        text, count = re.subn(pattern, replacement, path.read_text())
        assert count, f"{file} no longer has {pattern}"
        path.write_text(text)

    def restore(self) -> None:
        for path, content in self.untouched.items():
            path.write_bytes(content)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workbench]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STYLETRF_STORE", str(tmp_path_factory.mktemp("store")))
        bench = Workbench(tmp_path_factory.mktemp("copy"))
        yield bench
    bench.process.communicate()


@pytest.fixture
def project(bench: Workbench) -> Iterator[Workbench]:
    yield bench
    bench.restore()


def test_the_snapshot_is_that_of_the_code():
    there, now = Snapshot.read(), snapshot_of(families("tasks"))
    names = {f for f, code in now.families.items() if there.families.get(f) != code}
    assert (there.families, there.code) == (now.families, now.code), (
        f"tasks/identity.json is behind the code of {sorted(names) or 'families that are gone'}."
        " If their results change, write it again: python -m pipeline snapshot. If not:"
        f" python -m pipeline adopt {' '.join(sorted(names))} --reason '...'"
    )


def test_comments_docstrings_and_formatting_change_no_code(project: Workbench):
    """A quarter of the modules, another one each day, written from their syntax trees."""
    modules = [*project.folder.glob("styletrf/**/*.py"), *project.folder.glob("tasks/**/*.py")]
    today = datetime.now(UTC).toordinal()
    for path in sorted(modules)[today % 4 :: 4]:
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                body = node.body[1:] if ast.get_docstring(node) else node.body
                node.body = [ast.Expr(ast.Constant("Something else.")), *body]
        lines = ast.unparse(ast.fix_missing_locations(tree)).splitlines()
        path.write_text("# A comment.\n" + "".join(f"{line}\n\n" for line in lines))
    assert project.changed() == set()


CLIPS = "PriorRenders TrajectoryFrames StylizedFrames"
OF_PIECES = {  # a piece of code, or a file of a package, and the families whose results may change
    "styletrf.capture.views:HOLD_OUT_EVERY": "CameraPoses SceneReport",
    "styletrf.field.occupancy:VOXELS_PER_LATTICE_POINT": "RadianceField SceneReport StylizedField",
    "styletrf.files.video:_ENCODERS": CLIPS,
    "styletrf.style.style_network:OUTPUT_SCALE": "StyleNetwork StylizedPriors StylizedFrames",
    "styletrf.evaluation.metrics:_WINDOW": "QualityMetrics",
    "styletrf.evaluation.flow:_SMALLEST_SIDE": "ConsistencyMetrics",
    "styletrf.stylization.adaptation:AdaptationConfig": "StylizedField",
    "styletrf/reports/page_template.html": "StylizedTrajectory SceneReport TradeOff",
    "styletrf.synthetic.courtyard.lighting:SUN_COLOR": "",
}


@pytest.fixture(scope="module")
def closures() -> dict[str, dict[str, str]]:
    """The pieces of code of each family."""
    return {kind.task_family: code_closure(kind) for kind in families("tasks")}


@pytest.mark.parametrize(("piece", "expected"), OF_PIECES.items())
def test_a_piece_of_code_counts_for_exactly_what_depends_on_it(
    closures: dict[str, dict[str, str]], piece: str, expected: str
):
    module, _, name = piece.partition(":")
    assert not name or name in read(module).bindings, f"there is no {piece} any more"
    assert {family for family, code in closures.items() if piece in code} == set(expected.split())


EDITS = {  # file, what is replaced by what, and the families whose keys change
    "three imports away": ("styletrf/files/video.py", "_ENCODERS = {", "_ENCODERS = {**{},", CLIPS),
    "a setting, in the keys by value, but shown by the report": (
        "tasks/presets/presets.py",
        "1536, 3072",
        "1537, 3072",
        "StylizedTrajectory SceneReport TradeOff",
    ),
}


@pytest.mark.parametrize(("file", "old", "new", "expected"), EDITS.values(), ids=EDITS)
def test_an_edit_changes_exactly_what_depends_on_it(
    project: Workbench, file: str, old: str, new: str, expected: str
):
    project.edit(file, re.escape(old), new)
    assert project.changed() == set(expected.split())


def test_a_rename_that_is_adopted_changes_no_key(project: Workbench):
    for path in project.folder.rglob("*.py"):
        if "read_split" in path.read_text():
            project.edit(str(path.relative_to(project.folder)), r"\bread_split\b", "split_read")
    users = project.changed()
    assert {"QualityMetrics", "TrajectoryFrames"} <= users < project.before.keys()
    others = users - {"QualityMetrics"}
    adopted = project.changed("adopt", "QualityMetrics", "--reason", "a rename")
    assert adopted == others, "a declaration speaks of its family only"
    assert project.changed("adopt", *others, "--reason", "a rename") == set()
    project.edit("styletrf/geometry/camera_table.py", r"parts\[held_out\]", "parts[not held_out]")
    assert project.changed() == users, "an adoption does not cover the next edit"


def test_a_revision_stands_in_the_snapshot_as_such(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tasks.RadianceField, "revision", "2")
    snapshot = snapshot_of([tasks.RadianceField, tasks.SceneModel])
    assert snapshot.families["RadianceField"] == "revision 2"
    assert len(snapshot.families["SceneModel"]) == 64


def test_why_of_the_whole_graph_is_quick_and_loads_no_torch(photographs: Path):
    words = ["--scene", "mini", "--style", "p", "--quality", "draft", "--content", "embedded"]
    current_store()  # the command makes none
    code = f"""
import sys, time
started = time.perf_counter()
from pipeline.maintenance.command_line import main
assert main(["why", "--json", "StylizedTrajectory", *{words}]) == 0
assert not {{"torch", "numba", "pycolmap"}} & set(sys.modules)
assert time.perf_counter() - started < 5, "usually 1.3 s"
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "STYLETRF_DATA": str(photographs)},
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    states = {row["task"].split()[0]: row["state"] for row in json.loads(done.stdout)}
    others = {"Export", "Grid", "SceneReport", "StylizationMetrics", "TradeOff", "Viewer"}
    assert states.keys() == set(tasks.__all__) - others
    assert states["StyleImage"] == "the first of its family"
    assert mentions(states["StylizedTrajectory"], "QualityMetrics", "TrajectoryFrames")


DISTRIBUTIONS = {
    "av": "av",
    "cv2": "opencv-contrib-python-headless",
    "numba": "numba",
    "pycolmap": "pycolmap",
}
"""What decodes and computes, and whose version decides bytes."""


def _packages(module: str, name: str) -> set[str]:
    """The packages outside the project that a piece of its code names, through re-exports too."""
    source = read(module)
    first, *rest = name.split(".")
    pieces = source.members.get(first, {}) if rest else source.bindings
    code = ast.Module(pieces.get(rest[0] if rest else first, []), [])
    imports = {**source.imports, **imports_in(code, source.package)}
    found = [each for path in dotted_names(code) for each in imports.get(path[0], [])]
    outside = {target[0].split(".")[0] for target in found}
    for target in found:
        if target[0] == "styletrf.colmap":
            outside |= {each[0] for each in read(target[0]).imports[target[1]]}
    return outside


def test_the_versions_of_what_computes_are_in_the_key():
    """A new PyAV, OpenCV, numba or pycolmap makes again what it decodes or computes."""
    for stage in families("tasks"):
        members = [name.partition(":") for name in code_closure(stage) if ":" in name]
        packages = {p for module, _, name in members for p in _packages(module, name)}
        needed = {DISTRIBUTIONS[package] for package in packages & DISTRIBUTIONS.keys()}
        assert needed <= set(stage.tools), stage.task_family


COMMANDS = {"Grid", "StylizedTrajectory", "TradeOff"}
"""They gather what the records of a whole graph say; `test_fly_through` runs them."""

BY_VALUE = {
    "tasks.stages.field:TrajectoryFrames.values",
    "tasks.stages.path_parameters:PathParameters.path_settings",
    "tasks.presets.presets:settings_for",
    "tasks.stages.stage:ConfigurableStage.values",
    "tasks.stages.stage:PresetStage.get_param_values",
    "tasks.stages.stage:PresetStage.tuned",
    "tasks.stages.style:StyleNetwork.values",
    "tasks.stages.stylization:StylizedField.resolved_match",
    "tasks.stages.stylization:StylizedField.values",
    "tasks.stages.stage:Stage.upstream",
    "tasks.stages.style:StyleNetwork.identity_parameters",
    "tasks.stages.style:StyleNetwork.measured_pairs",
    "tasks.stages.style:StyleNetwork.requires",
    "tasks.stages.stylization:StylizedPriors.factors",
    "tasks.stages.stylization:StylizedPriors.values",
}
"""What `identity_parameters` returns stands in the key itself."""


def test_all_that_a_build_runs_is_in_its_code(mini: Callable[..., Path]):
    """Every function that Python runs while a stage builds was found without running anything."""
    for family in sorted(set(tasks.__all__) - COMMANDS - {"CameraPoses"}):
        called = functions_called_for(mini(family))
        known = code_closure(getattr(tasks, family)).keys() | BY_VALUE
        names = {re.sub(r"\.?<.*", "", name) for name in called}
        named = {name for name in names if not name.endswith(":")}  # no lambda of a table
        assert {name for name in named if not {name, name.rpartition(".")[0]} & known} == set()
        assert any(name.startswith("styletrf") for name in names), family
