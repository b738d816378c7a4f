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
from styletrf.style.gatys import GatysConfig
from tasks.planning.memory_demand import Photographs
from tasks.planning.stage_costs import REFERENCE, CostModel, reference_costs
from tasks.planning.stage_drivers import LONGEST_DESCRIBED, MOST_FEATURES, drivers_of
from tasks.planning.stage_work import OPTIMIZATION_ITERATIONS, START_S, seconds_scaled

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


PAINTED = {"style": "p", "content": "embedded"}
UNTRAINED = ({"stylizer": "arbitrary"}, {"stylizer": "gatys"}, {"network": "n.pth"})


@pytest.mark.parametrize("words", UNTRAINED, ids=str)
@pytest.mark.parametrize("iterations", [5000, 10000])
def test_a_network_that_is_not_trained_takes_the_start_of_a_stage_whatever_fields_take(
    words, iterations
):
    """It was priced as a training with the iterations and the batch of the field."""
    tuning = {"RadianceField": {"iterations": iterations}}
    network = stage("StyleNetwork", tuning=tuning, **PAINTED, **words)
    assert model().expected(network).seconds == pytest.approx(START_S)
    took(stage("StyleNetwork", **PAINTED), 600.0)
    assert model().expected(network).seconds == pytest.approx(START_S)


def kinds(family: str) -> list[dict[str, str]]:
    """Words for stages of one family that do different work."""
    others = {
        "StyleNetwork": UNTRAINED[0],
        "StylizedPriors": {"stylizer": "gatys"},
        "StylizedField": {"strategy": "s1"},
    }
    return [{}, others[family]]


@pytest.mark.parametrize("family", ["StyleNetwork", "StylizedPriors", "StylizedField"])
@pytest.mark.parametrize("is_reversed", [False, True])
def test_a_build_does_not_predict_another_kind_of_work_of_its_family(family, is_reversed):
    """After one build with `arbitrary`, a training was predicted at its 1.5 s."""
    known, other = sorted(kinds(family), key=len, reverse=is_reversed)
    took(stage(family, **PAINTED, **known), 77.0)
    assert model().expected(stage(family, **PAINTED, **known)).evidence == "this machine"
    found, without = (
        each.expected(stage(family, **PAINTED, **other))
        for each in (model(), model(uses_own_builds=False))
    )
    assert found == without


def test_a_new_field_takes_as_long_as_the_field_with_the_same_settings():
    for own, of_style in (({}, {}), ({"iterations": 9000}, {"fit.iterations": 9000})):
        field = stage(tuning={"RadianceField": own})
        new = stage("StylizedField", strategy="s1", tuning={"StylizedField": of_style}, **PAINTED)
        assert model().expected(new).seconds == pytest.approx(model().expected(field).seconds)


def test_a_field_that_is_fitted_on_sees_as_many_rays_as_an_adaptation():
    tuning = {"StylizedField": {"adaptation.iterations": 100, "adaptation.batch": 3072}}
    on = stage("StylizedField", strategy="s2", tuning=tuning, **PAINTED)
    rays = {"StylizedField": {"fit.iterations": 200, "fit.batch": 1536}}
    new = stage("StylizedField", strategy="s1", tuning=rays, **PAINTED)
    assert model().expected(on).seconds == pytest.approx(model().expected(new).seconds)


def test_an_optimization_of_priors_takes_longer_by_its_iterations_for_each_prior():
    def added(count=13, **settings):
        """The seconds that an optimization takes more than a network."""
        tuning = {"StylizedPriors": settings, "PriorRenders": {"coverage.count": count}}
        words = {**PAINTED, "tuning": tuning}
        network, optimization = (
            model().expected(stage("StylizedPriors", stylizer=stylizer, **words)).seconds
            for stylizer in ("johnson", "gatys")
        )
        return optimization - network

    assert added() > 100
    assert added(iterations=[120, 40]) == pytest.approx(2 * added())
    assert added(count=26) == pytest.approx(2 * added())
    assert sum(GatysConfig().iterations) == OPTIMIZATION_ITERATIONS


def test_an_optimization_of_the_priors_of_horns_takes_what_was_measured():
    """13 priors (benchmarks/history.md); it was predicted at the 2 s of a network."""
    reference = reference_costs()
    words = {"scene": reference.scene, "quality": "draft", "stylizer": "gatys"}
    priors = tasks.StylizedPriors(**PAINTED, **words)
    assert model().expected(priors).seconds == pytest.approx(588, rel=0.02)


@pytest.mark.parametrize("strategy", ["s1", "s2"])
def test_frames_with_depths_of_their_own_take_more_of_the_disk(strategy):
    plain, own = (
        model().expected(stage("StylizedFrames", strategy=each, **PAINTED)).output_bytes
        for each in ("s3", strategy)
    )
    assert own > 2 * plain
