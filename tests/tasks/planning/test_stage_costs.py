"""What stages are expected to take: by builds of this machine, or by the reference."""

import json
import socket
from dataclasses import replace

import pytest
from luigi.cmdline_parser import CmdlineParser

import tasks
from pipeline.execution.cost_history import Cost, CostSample, record_cost
from pipeline.execution.resources import significant
from pipeline.maintenance.task_graph import upstream_first
from pipeline.settings import current_store
from styletrf.sfm.camera_poses import CameraPosesConfig
from tasks.planning.memory_demand import Photographs
from tasks.planning.stage_costs import REFERENCE, CostModel, reference_costs
from tasks.planning.stage_work import (
    LONGEST_DESCRIBED,
    MOST_FEATURES,
    START_S,
    drivers_of,
    seconds_scaled,
)

SIZE = {"mini": Photographs(40, 504, 378)}


def model(**changes) -> CostModel:
    reference = reference_costs()
    return CostModel(reference.calibration, SIZE, reference, **changes)


def stage(family="RadianceField", quality="draft", **words):
    return getattr(tasks, family)(scene="mini", quality=quality, **words)


def took(task, seconds, host=""):
    cost = Cost(seconds, 1 << 20, seconds, 1000)
    record_cost(current_store(), task.task_family, CostSample(significant(task), cost, host))


def test_the_reference_expects_of_itself_what_it_took():
    reference = reference_costs()
    for family in ("RadianceField", "TrajectoryFrames", "CameraPoses"):
        like = reference.stage_like(stage(family))
        cost = model().expected(like)
        assert cost.seconds == pytest.approx(reference.stages[family].seconds)
        assert cost.evidence == "the reference"


@pytest.mark.parametrize("family", ["RadianceField", "StyleNetwork", "CameraPoses"])
def test_a_machine_twice_as_slow_takes_twice_as_long(family):
    words = {"style": "p", "content": "embedded"} if family == "StyleNetwork" else {}
    here = reference_costs().calibration
    slow = replace(here, seconds={k: 2 * v for k, v in here.seconds.items()})
    slower = CostModel(slow, SIZE, reference_costs())
    one, other = (m.expected(stage(family, **words)) for m in (model(), slower))
    assert other.seconds == pytest.approx(2 * one.seconds)
    assert other.output_bytes == one.output_bytes


def test_builds_of_this_machine_go_before_the_reference():
    took(stage(), 77.0, socket.gethostname())
    assert model().expected(stage()).seconds == pytest.approx(77.0)
    assert model().expected(stage()).evidence == "this machine"
    assert model(uses_own_builds=False).expected(stage()).evidence == "the reference"


def test_builds_of_another_machine_do_not_go_before_the_reference():
    took(stage(), 77.0, "another")
    assert model().expected(stage()).evidence == "the reference"


@pytest.mark.parametrize(
    ("more", "family"),
    [
        ({"RadianceField": {"iterations": 10000}}, "RadianceField"),
        ({"TrajectoryFrames": {"trajectory.frames": 600}}, "TrajectoryFrames"),
        ({"TrajectoryFrames": {"long_side_px": 1008}}, "TrajectoryFrames"),
        ({"SceneModel": {"max_voxels": 10**9}}, "RadianceField"),
    ],
)
def test_more_work_takes_longer(more, family):
    took(stage(family), 50.0)
    for each in (model(), model(uses_own_builds=False)):
        assert (
            each.expected(stage(family, tuning=more)).seconds > each.expected(stage(family)).seconds
        )


def test_priors_of_larger_photographs_keep_their_size_and_frames_do_not():
    words = {"style": "p", "content": "embedded", "quality": "standard"}

    def drivers(family, width_px):
        wanted = getattr(tasks, family)(scene="mini", **words)
        return drivers_of(wanted, {"mini": Photographs(40, width_px, width_px * 3 // 4)})

    priors, of_large, of_small = (drivers("StylizedField", px) for px in (504, 1008, 252))
    assert of_large["frame_pixels"] == priors["frame_pixels"] == 504 * 378
    assert of_small["frame_pixels"] == 252 * 189
    frames = drivers("StylizedFrames", 1008)
    assert frames["frame_pixels"] == 4 * drivers("StylizedFrames", 504)["frame_pixels"]


@pytest.mark.parametrize(
    ("size", "settings", "longest"),
    [
        ((1008, 756), {}, 1008),
        ((4032, 3024), {}, CameraPosesConfig().max_image_long_side),
        ((4032, 3024), {"max_image_long_side": 800}, 800),
    ],
)
def test_features_of_larger_photographs_take_longer_up_to_the_size_they_are_described_at(
    size, settings, longest
):
    def seconds(width, height, **words):
        sizes = {"mini": Photographs(40, width, height)}
        poses = stage("CameraPoses", **words)
        return CostModel(reference_costs().calibration, sizes, reference_costs()).expected(poses)

    pixels = Photographs(40, *size).pixels(longest)
    fraction = (seconds(*size, settings=settings).seconds - START_S) / (
        seconds(504, 378).seconds - START_S
    )
    assert fraction == pytest.approx((pixels / (504 * 378)) ** 0.7, rel=0.01)
    assert CameraPosesConfig().max_image_long_side == LONGEST_DESCRIBED


def test_frames_of_a_video_take_less_by_the_features_that_they_have_fewer():
    config = CameraPosesConfig()
    of_photographs, of_frames = (
        CostModel(reference_costs().calibration, {"mini": sizes}, reference_costs())
        .expected(stage("CameraPoses"))
        .seconds
        for sizes in (SIZE["mini"], replace(SIZE["mini"], filmed_pixels=1e9))
    )
    fraction = (of_frames - START_S) / (of_photographs - START_S)
    assert fraction == pytest.approx((config.video_features / config.max_features) ** 0.6)
    assert all(getattr(config, name) == most for name, most in MOST_FEATURES.items())


def test_settings_of_the_command_are_those_of_the_stage_and_not_of_the_reference():
    words = ["RadianceField", "--scene", "mini", "--quality", "draft"]
    with CmdlineParser.global_instance([*words, "--settings", '{"iterations": 500}']) as command:
        few = model().expected(command.get_task_obj()).seconds
    with CmdlineParser.global_instance(
        ["QualityMetrics", *words[1:], "--RadianceField-settings", '{"iterations": 500}']
    ) as command:
        (field,) = (
            s for s in upstream_first(command.get_task_obj()) if s.task_family == "RadianceField"
        )
        assert model().expected(field).seconds == pytest.approx(few)
    assert few < 0.2 * model().expected(stage()).seconds


def test_the_start_of_a_stage_does_not_grow():
    assert seconds_scaled(START_S, START_S, 100.0) == START_S
    assert seconds_scaled(10.0, START_S, 2.0) == START_S + 2 * (10.0 - START_S)


def test_the_reference_has_every_stage_of_a_fly_through():
    words = {"scene": "s", "style": "p", "content": "embedded"}
    families = {t.task_family for t in upstream_first(tasks.StylizedTrajectory(**words))}
    assert families <= json.loads(REFERENCE.read_text())["stages"].keys()


FILM = Photographs(40, 1920, 1080, filmed_pixels=1800 * 1920 * 1080)


def film_model(**changes) -> CostModel:
    reference = reference_costs()
    return CostModel(reference.calibration, {"mini": FILM}, reference, **changes)


def test_frames_of_a_video_take_seconds_that_photographs_do_not():
    capture = stage("SceneCapture")
    photographs, film = model().expected(capture), film_model().expected(capture)
    longer = replace(FILM, filmed_pixels=2 * FILM.filmed_pixels)
    twice = CostModel(reference_costs().calibration, {"mini": longer}, reference_costs())
    added_s = film.seconds - photographs.seconds
    assert added_s > 10
    assert twice.expected(capture).seconds - photographs.seconds == pytest.approx(2 * added_s)


def test_a_capture_of_photographs_does_not_tell_what_one_of_a_video_takes():
    reference = reference_costs()
    took(stage("SceneCapture"), 2.0, socket.gethostname())
    sizes = {"mini": SIZE["mini"], "film": FILM}
    film = tasks.SceneCapture(scene="film", quality="draft")
    costs = CostModel(reference.calibration, sizes, reference)
    assert costs.expected(stage("SceneCapture")).evidence == "this machine"
    assert costs.expected(film).evidence == "the reference"
