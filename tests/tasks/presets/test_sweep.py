"""The designed sweep: its baseline, its changes, and what it calls the usual values."""

from functools import reduce

import pytest
from expected_errors import rejects

from styletrf.evaluation.trade_off import merged
from tasks.planning.request_validation import configurations
from tasks.presets.presets import PRESETS
from tasks.presets.sweep import (
    COMBINED_CHANGES,
    CONFIG_DEFAULTS,
    SWEEP_AXES,
    baseline_settings,
    sweep,
)


@pytest.mark.parametrize("quality", PRESETS)
def test_every_change_is_a_setting_of_its_stage_and_changes_something(quality):
    baseline = baseline_settings(quality, {})
    changes = [variant for variant in sweep(baseline, 1) if variant.name]
    assert len(changes) >= 25
    assert len({(v.part, v.name) for v in changes}) == len(changes)
    for variant in changes:
        for stage, settings in variant.tuning.items():
            from styletrf.configuration import configured

            configured(configurations()[stage], settings)
        assert variant.stylizer or any(
            baseline.get(stage, {}).get(name) != value
            for stage, settings in variant.tuning.items()
            for name, value in settings.items()
        )


def test_a_sweep_has_the_stylizer_that_trains_no_network():
    painted = [v for v in sweep(baseline_settings("draft", {}), 1) if v.stylizer]
    assert [(v.part, v.stylizer, v.tuning) for v in painted] == [("style", "arbitrary", {})]


def test_the_usual_values_are_those_of_the_configurations():
    for stage, settings in CONFIG_DEFAULTS.items():
        for name, value in settings.items():
            configuration = configurations()[stage]()
            assert reduce(getattr, name.split("."), configuration) == value


def test_changes_are_factors_of_what_is_tuned():
    baseline = baseline_settings("draft", {"RadianceField": {"iterations": 100}})
    by_name = {v.name: v.tuning for v in sweep(baseline, 1)}
    assert by_name["iterations x 0.5"] == {"RadianceField": {"iterations": 50}}
    assert by_name["ranks x 2"]["RadianceField"]["field.density_ranks"] == [32]


def test_repeats_differ_in_seeds_alone_and_the_first_in_nothing():
    repeats = [v for v in sweep(baseline_settings("draft", {}), 3) if not v.name]
    assert [v.part for v in repeats] == ["scene", "style"] * 3
    assert [v.tuning for v in repeats[:2]] == [{}, {}]
    names = {n.split(".")[-1] for v in repeats for s in v.tuning.values() for n in s}
    assert names == {"seed"}


def test_what_changes_nothing_is_left_out():
    names = {
        v.name for v in sweep(baseline_settings("draft", {"StyleNetwork": {"bfloat16": False}}), 1)
    }
    assert "network in float32" not in names
    assert "network in float32" in {v.name for v in sweep(baseline_settings("draft", {}), 1)}


def test_a_baseline_setting_that_is_not_a_number_is_refused():
    with rejects("iterations", "'many'", remedy=["--tuning"]):
        sweep(baseline_settings("draft", {"RadianceField": {"iterations": "many"}}), 1)


def test_several_changes_are_of_axes_there_are():
    known = {axis.name: axis.part for axis in SWEEP_AXES}
    for (part, _), factors in COMBINED_CHANGES.items():
        assert {known[name] for name in factors} == {part}


SMALLER = "photographs' size x 0.75"


@pytest.mark.parametrize("quality", PRESETS)
def test_frames_of_smaller_photographs_have_the_size_that_they_have_without_the_change(quality):
    """Those of photographs below the working size were enlarged."""
    baseline = baseline_settings(quality, {})
    (variant,) = (v for v in sweep(baseline, 1) if v.name == SMALLER)
    seen = baseline["SceneModel"]["image_long_side"]
    assert variant.tuning["TrajectoryFrames"] == {"long_side_px": seen, "enlarged": False}
    assert variant.tuning["QualityMetrics"] == {"long_side_px": seen}


def test_a_size_of_frames_that_is_tuned_stays_in_every_variant():
    tuning = {"TrajectoryFrames": {"long_side_px": 1920}}
    for variant in sweep(baseline_settings("draft", tuning), 1):
        assert merged(tuning, variant.tuning)["TrajectoryFrames"]["long_side_px"] == 1920


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_no_repeat_has_the_seeds_of_another_one_whatever_is_tuned(seed):
    """A tuned seed was that of a repeat, whose artifact was measured twice."""
    tuning = {
        "RadianceField": {"seed": seed},
        "StyleNetwork": {"seed": seed},
        "StylizedField": {"adaptation.seed": seed},
    }
    repeats = [v for v in sweep(baseline_settings("draft", tuning), 3) if not v.name]
    for part in ("scene", "style"):
        found = [str(merged(tuning, v.tuning)) for v in repeats if v.part == part]
        assert len(set(found)) == 3
