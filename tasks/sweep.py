"""The designed sweep over the knobs: one change at a time around a quality, and a few together.

Changes are relative to the quality's own values, so that the sweep fits any of them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from tasks.qualities import settings_for


@dataclass(frozen=True, slots=True)
class Variant:
    """What is changed on one side of the graph; the name is empty for nothing but a seed."""

    part: Literal["scene", "style"]
    name: str
    tuning: Mapping[str, Mapping[str, Any]]


def sweep(quality: str, tuning: Mapping[str, Mapping[str, Any]], repeats: int) -> list[Variant]:
    """Returns the variants to measure around a quality, the unchanged one first and repeated.

    Args:
        quality: A column of `tasks/qualities.py`.
        tuning: Settings by stage that replace the quality's, also in the middle.
        repeats: How often the middle is measured, each time with other seeds.
    """
    around = {
        family: {**settings_for(family, quality), **tuning.get(family, {})}
        for family in ("SceneModel", "RadianceField", "StyleNetwork", "StylizedField")
    }
    return [*_repeated(repeats), *_of_scene(around), *_of_style(around)]


def _repeated(repeats: int) -> Iterator[Variant]:
    for seed in range(repeats):
        style = {"StyleNetwork": {"seed": seed}, "StylizedField": {"adaptation.seed": seed}}
        yield Variant("scene", "", {"RadianceField": {"seed": seed}} if seed else {})
        yield Variant("style", "", style if seed else {})


def _of_scene(around: Mapping[str, Mapping[str, Any]]) -> Iterator[Variant]:
    model, field = around["SceneModel"], around["RadianceField"]
    long_side = model["image_long_side"]

    def fit(**settings: Any) -> dict[str, dict[str, Any]]:
        return {"RadianceField": {n.replace("__", "."): v for n, v in settings.items()}}

    def ranks(factor: float) -> dict[str, Any]:
        return {
            f"field.{kind}_ranks": [max(1, round(factor * r)) for r in field[f"field.{kind}_ranks"]]
            for kind in ("density", "appearance")
        }

    def voxels(factor: float) -> dict[str, dict[str, Any]]:
        return {"SceneModel": {"max_voxels": round(factor * model["max_voxels"])}}

    def pixels(factor: float) -> dict[str, dict[str, Any]]:
        return {
            "SceneModel": {"image_long_side": round(factor * long_side)},
            "QualityMetrics": {"long_side_px": long_side},
        }

    def times(factor: float) -> int:
        iterations: int = field["iterations"]
        return round(factor * iterations)

    for factor in (0.25, 0.5, 2.0):
        yield Variant("scene", f"iterations x {factor:g}", fit(iterations=times(factor)))
    for factor in (0.5, 2.0):
        rays = {n: round(factor * field[n]) for n in ("batch", "batch_samples")}
        yield Variant("scene", f"batch x {factor:g}", fit(**rays))
    for factor in (0.25, 0.5, 2.0):
        yield Variant("scene", f"voxels x {factor:g}", voxels(factor))
    for factor in (0.5, 2.0):
        yield Variant("scene", f"ranks x {factor:g}", {"RadianceField": ranks(factor)})
    yield Variant("scene", "steps a voxel x 0.7", fit(steps_per_voxel=0.5))
    yield Variant("scene", "faint samples left out", fit(min_weight=0.01, termination=0.01))
    yield Variant("scene", "photographs x 0.75", pixels(0.75))
    yield Variant("scene", "frames to 3 %", _frames(0.03))
    yield Variant("scene", "frames to 0.3 %", _frames(0.003))
    quick = {"RadianceField": {**ranks(0.5), "iterations": times(0.5)}}
    yield Variant("scene", "quick", voxels(0.5) | quick)
    least = {"RadianceField": {**ranks(0.5), "iterations": times(0.25)}}
    yield Variant("scene", "least", {**voxels(0.25), **least, **_frames(0.03)})
    most = {"RadianceField": {**ranks(1.5), "iterations": times(2.0)}}
    yield Variant("scene", "most", {**voxels(2.0), **most, **_frames(0.003)})


def _frames(faint: float) -> dict[str, dict[str, Any]]:
    """Rays end and samples are left out at this share of a pixel, in every render."""
    nested = {"render.termination": faint, "render.min_weight": faint}
    return {
        "TrajectoryFrames": nested,
        "PriorRenders": nested,
        "QualityMetrics": nested,
        "StylizedFrames": {"termination": faint, "min_weight": faint},
    }


def _of_style(around: Mapping[str, Mapping[str, Any]]) -> Iterator[Variant]:
    network, adaptation = around["StyleNetwork"], around["StylizedField"]

    def train(**settings: Any) -> dict[str, dict[str, Any]]:
        return {"StyleNetwork": {n.replace("__", "."): v for n, v in settings.items()}}

    def adapt(**settings: Any) -> dict[str, dict[str, Any]]:
        return {"StylizedField": {f"adaptation.{n}": v for n, v in settings.items()}}

    def times(factor: float) -> int:
        iterations: int = network["iterations"]
        return round(factor * iterations)

    def rounds(factor: float) -> int:
        iterations: int = adaptation["adaptation.iterations"]
        return round(factor * iterations)

    def covered(times: float) -> dict[str, dict[str, Any]]:
        return {"PriorRenders": {"coverage.times": times}}

    for factor in (0.25, 0.5, 2.0):
        yield Variant("style", f"network iterations x {factor:g}", train(iterations=times(factor)))
    narrow = train(network__width=16, warm_start=False)
    yield Variant("style", "network of width 16", narrow)
    small = train(crop_px=round(0.75 * network["crop_px"]))
    yield Variant("style", "network crops x 0.75", small)
    yield Variant("style", "network in float32", train(bfloat16=False))
    for factor in (0.25, 0.5, 2.0):
        name = f"adaptation iterations x {factor:g}"
        yield Variant("style", name, adapt(iterations=rounds(factor)))
    yield Variant("style", "larger cache", adapt(min_weight=1e-3))
    yield Variant("style", "smaller cache", adapt(min_weight=3e-2))
    yield Variant("style", "priors that cover once", covered(1))
    yield Variant("style", "priors that cover 6 times", covered(6))
    quick = train(iterations=times(0.5)) | adapt(iterations=rounds(0.5)) | covered(2)
    yield Variant("style", "quick", quick)
    least = train(iterations=times(0.25)) | adapt(iterations=rounds(0.25)) | covered(1)
    yield Variant("style", "least", least)
