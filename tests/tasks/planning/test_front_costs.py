"""What stages take by what a front has measured, and the parts of an optimization."""

from dataclasses import replace

import pytest

import tasks
from tasks.planning.memory_demand import Photographs
from tasks.planning.stage_costs import CostModel, MeasuredSeconds, reference_costs
from tasks.planning.stage_work import START_S, seconds_scaled

SIZE = Photographs(40, 504, 378)
FILM = Photographs(40, 1920, 1080, filmed_pixels=1800 * 1920 * 1080)
OPTIMIZED = {"style": "p", "content": "embedded", "stylizer": "gatys"}


def model(size=SIZE) -> CostModel:
    return CostModel(reference_costs().calibration, {"mini": size}, reference_costs())


def stage(family, **words):
    return getattr(tasks, family)(scene="mini", quality="standard", **words)


def on_front(stage, seconds=600.0, photographs=None) -> MeasuredSeconds:
    """The seconds of a stage of a front that this machine measured."""
    return MeasuredSeconds(seconds, stage, reference_costs().calibration, photographs)


@pytest.mark.parametrize(
    ("settings", "width_px", "ratio"),
    [({}, 504, 1), ([30, 10], 504, 0.5), ([6, 2], 504, 0.1), ({}, 252, 4), ([120, 40], 252, 8)],
)
def test_an_optimization_of_a_front_is_scaled_by_iterations_and_pixels_alone(
    settings, width_px, ratio
):
    """The optimization was added to seconds that contain it: 8 iterations took -468 s."""
    tuning = {"StylizedPriors": {"iterations": settings}} if settings else {}
    there = Photographs(40, width_px, width_px * 3 // 4)
    measured = on_front(stage("StylizedPriors", **OPTIMIZED), photographs=there)
    found = model().expected(stage("StylizedPriors", tuning=tuning, **OPTIMIZED), measured)
    assert found.seconds == pytest.approx(seconds_scaled(600.0, START_S, ratio))


def test_a_film_of_a_front_is_scaled_by_its_frames_alone():
    capture = tasks.SceneCapture(scene="mini")
    shorter = replace(FILM, filmed_pixels=FILM.filmed_pixels // 2)
    found = model(FILM).expected(capture, on_front(capture, 30.0, shorter))
    assert found.seconds == pytest.approx(seconds_scaled(30.0, START_S, 2))


@pytest.mark.parametrize(("here", "there"), [("gatys", "johnson"), ("johnson", "gatys")])
def test_a_front_does_not_predict_another_kind_of_work(here, there):
    priors, measured = (
        stage("StylizedPriors", **{**OPTIMIZED, "stylizer": each}) for each in (here, there)
    )
    assert model().expected(priors, on_front(measured)) == model().expected(priors)


def test_joining_the_shards_of_an_optimization_optimizes_nothing():
    def seconds(**words):
        return model().expected(stage("StylizedPriors", **{**OPTIMIZED, **words})).seconds

    assert seconds(shards=4) == pytest.approx(seconds(shards=4, stylizer="johnson"))
    assert 4 * (seconds(shard="1/4") - START_S) == pytest.approx(seconds() - START_S)
