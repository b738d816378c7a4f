"""A style network trained by several processes, as on several GPUs; here on cores."""

import pytest
from expected_errors import rejects
from luigi.cmdline_parser import CmdlineParser

from styletrf.files.tables import read_rows
from styletrf.style.style_network import load_style_network
from tasks.stages.distributed_training import (
    TrainingRequest,
    processes_for,
    train_distributed,
    train_local,
)
from tasks.stages.metrics import ConsistencyMetrics
from tasks.stages.pair_settings import pair_settings
from tasks.stages.style import StyleNetwork


class Display:
    def __init__(self):
        self.seen, self.said = [], []

    def __call__(self, done, total, **quality):
        self.seen.append((done, total, quality))

    def say(self, line):
        self.said.append(line)

    def close(self):
        pass


@pytest.fixture
def asked(stage_of, tmp_path):
    stage, inputs = stage_of("StyleNetwork")
    for name in ("out", "resume"):
        (tmp_path / name).mkdir()

    def ask(**settings):
        return TrainingRequest(
            settings={**stage.values(), "batch": 2, "bfloat16": False, **settings},
            stroke_scale=1.0,
            content_weight=1.0,
            inputs={name: str(path) for name, path in inputs.items()},
            out=str(tmp_path / "out"),
            resume=str(tmp_path / "resume"),
            device="cpu",
        )

    return ask


def test_a_network_trains_on_no_pair_of_renders_that_this_command_measures(stage_of, build):
    """Here all are measured, so that none is left."""
    settings = {"temporal_loss.renders": 1.0, "temporal_loss.weight": 1.0}
    every = {"ConsistencyMetrics": {"deltas": [1, 2, 3, 4, 5], "pairs": 99}}
    usual, _ = stage_of("StyleNetwork", settings=settings)
    stage, inputs = stage_of("StyleNetwork", settings=settings, tuning=every)
    assert usual.identity_parameters() != stage.identity_parameters()
    with rejects("temporal_loss.renders", 7, remedy=["`pairs`", "ConsistencyMetrics"]):
        build(stage, **inputs)


def test_the_pairs_that_are_left_out_are_those_that_this_command_measures():
    words = {"scene": "s", "style": "t", "quality": "draft"}
    tuning = {"ConsistencyMetrics": {"deltas": [3], "pairs": 5}}
    pairs = pair_settings(StyleNetwork(**words, tuning=tuning))
    measured = ConsistencyMetrics(**words, tuning=tuning).values()
    assert tuning["ConsistencyMetrics"].items() <= pairs.items() <= measured.items()


@pytest.mark.parametrize(
    ("measured", "renders", "tuning", "is_refused"),
    [
        ('{"pairs": 5}', 0.5, {}, True),
        ('{"pairs": 5}', 0.0, {}, False),
        ('{"pairs": 5}', 0.5, {"ConsistencyMetrics": {"pairs": 6}}, False),
        ('{"flow": "dis"}', 0.5, {}, False),
        ('{"pairs": 12, "deltas": [1, 5], "depth_deltas": [7]}', 0.5, {}, False),
        ('{"pairs": 5, "deltas": [1, 5]}', 0.5, {}, True),
    ],
)
def test_measured_pairs_that_a_training_on_renders_would_not_see_are_refused(
    measured, renders, tuning, is_refused
):
    """Where they matter: without renders or with pairs by `--tuning`, both stages agree."""
    line = ["StyleNetwork", "--ConsistencyMetrics-settings", measured]
    with CmdlineParser.global_instance([*line, "--scene", "s", "--style", "t"]):
        settings = {"temporal_loss.renders": renders, "temporal_loss.weight": 0.5}
        stage = StyleNetwork(scene="s", style="t", settings=settings, tuning=tuning)
        if not is_refused:
            stage.validate()
            return
        with rejects("--ConsistencyMetrics-settings", remedy=["--tuning", '"pairs": 5']):
            stage.validate()


@pytest.mark.slow
def test_two_processes_train_one_network(asked, tmp_path):
    display = Display()
    train_distributed(asked(iterations=3), 2, display)
    load_style_network(tmp_path / "out", "cpu")
    assert len(read_rows(tmp_path / "out/curve.parquet")) == 3
    assert display.seen[-1][1] == 3
    assert [p.name for p in (tmp_path / "resume").iterdir()] == ["checkpoint.safetensors"]


@pytest.mark.slow
def test_a_refusal_by_one_process_is_reported_as_in_one_process(asked):
    with rejects("style training", "iteration 2", remedy=['"learning_rate"']):
        train_distributed(
            asked(iterations=30, learning_rate=1e30, final_learning_rate=1e30), 2, Display()
        )


@pytest.mark.parametrize(
    ("batch", "gpus", "processes"), [(1, 4, 1), (4, 3, 2), (4, 4, 4), (6, 4, 3), (4, 0, 1)]
)
def test_as_many_gpus_as_have_equal_parts_of_a_batch(batch, gpus, processes):
    assert processes_for(batch, gpus) == processes


@pytest.mark.parametrize(
    ("words", "most"), [({}, 2), ({"settings": {"batch": 6}}, 3), ({"stylizer": "gatys"}, 1)]
)
def test_a_training_leases_no_more_gpus_than_have_equal_parts_of_its_batch(words, most):
    stage = StyleNetwork(scene="s", style="t", quality="draft", gpus=3, **words)
    assert stage.options.max_gpus == most


def test_one_process_needs_nobody(asked, tmp_path):
    train_local(asked(iterations=2), Display())
    assert len(read_rows(tmp_path / "out/curve.parquet")) == 2
