"""Fronts and answers, by their definitions; and the page that shows them."""

import re
from dataclasses import replace

import pytest
from expected_errors import rejects
from headless import answer_of, needs_chromium
from message_words import mentions

from styletrf.evaluation.pareto_front import best_in, fastest_within, pareto_front, smallest_within
from styletrf.evaluation.trade_off import (
    Measurement,
    combinations,
    merged,
    spread_of,
    variants,
)
from styletrf.reports.trade_off.chart import busy_words, front_svg
from styletrf.reports.trade_off.page import QUESTIONS, TradeOffContent, write_trade_off_page


def scene(name="", psnr=25.0, field=100.0, frames=30.0, size=100, **more):
    seconds = {"RadianceField": field, "TrajectoryFrames": frames}
    tuning = {"RadianceField": {"iterations": field}} if name else {}
    kept = {"RadianceField": size}
    return Measurement("scene", name, tuning, psnr, seconds, 0.0, 10, kept, **more)


def style(name="", db=-5.0, network=180.0, frames=30.0, size=10, **more):
    seconds = {"StyleNetwork": network, "StylizedFrames": frames}
    tuning = {"StyleNetwork": {"iterations": network}} if name else {}
    kept = {"StyleNetwork": 4, "StylizedField": size}
    return Measurement("style", name, tuning, db, seconds, 0.0, 20, kept, **more)


MEASURED = [
    scene(), style(),
    scene("fast", 24.0, 50.0, size=50), scene("slow", 25.5, 200.0), scene("bad", 20.0, 150.0),
    style("short", -5.4, 60.0), style("long", -4.8, 400.0),
]  # fmt: skip


def test_every_variant_of_one_side_goes_with_every_one_of_the_other():
    points = combinations(MEASURED)
    assert len(points) == 4 * 3
    usual = next(p for p in points if not p.scene and not p.style)
    assert usual.seconds == 100 + 30 + 180 + 30
    assert usual.shortfall_db == pytest.approx(0.5)  # the scene's, more than the style's 0.2
    assert (usual.peak_memory_bytes, usual.model_bytes, usual.tuning) == (20, 114, {})
    both = next(p for p in points if (p.scene, p.style) == ("fast", "short"))
    assert both.tuning == {
        "RadianceField": {"iterations": 50},
        "StyleNetwork": {"iterations": 60},
    }
    assert both.shortfall_db == pytest.approx(1.5)


def test_a_combination_has_the_stylizer_and_the_consistency_of_its_style():
    painted = style("painted", consistency_ratio=1.3, stylizer="arbitrary")
    measured = [scene(), scene("fast"), style(), painted]
    points = {(p.scene, p.style): p for p in combinations(measured)}
    for name in ("", "fast"):
        point = points[name, "painted"]
        assert (point.consistency_ratio, point.stylizer) == (1.3, "arbitrary")
        assert (points[name, ""].consistency_ratio, points[name, ""].stylizer) == (None, "")


def test_the_consistency_of_the_unchanged_quality_is_the_mean_of_the_known_ones():
    repeats = [style(consistency_ratio=ratio) for ratio in (1.2, None, 1.4)]
    assert variants(repeats, "style")[0].consistency_ratio == pytest.approx(1.3)


@pytest.mark.parametrize("order", [1, -1])
def test_the_unchanged_quality_is_as_disturbed_and_takes_as_much_as_its_worst_repeat(order):
    busy = replace(scene(), other_cpu_share=0.5, peak_memory_bytes=30)
    unknown = replace(scene(), other_cpu_share=None)
    usual = variants([scene(), busy][::order], "scene")[0]
    assert (usual.other_cpu_share, usual.peak_memory_bytes) == (0.5, 30)
    assert variants([busy, unknown][::order], "scene")[0].other_cpu_share is None


def test_stages_that_render_follow_what_a_frame_costs():
    measured = [scene(), style(), scene("cheap frames", frames=15.0)]
    by_name = {p.scene: p for p in combinations(measured)}
    assert by_name["cheap frames"].seconds == 100 + 15 + 180 + 15


def test_a_change_shares_the_mean_of_what_it_shares_with_a_repeat():
    """The same artifact has one time, whichever point it is part of."""
    again = replace(style(network=100.0), seconds={"StyleNetwork": 100.0, "StylizedFrames": 30.0})
    priors = replace(style("priors"), seconds={"StyleNetwork": 180.0, "StylizedFrames": 20.0})
    seconds = {v.name: v.seconds for v in variants([style(), again, priors], "style")}
    assert seconds[""]["StyleNetwork"] == seconds["priors"]["StyleNetwork"] == 140.0
    assert seconds["priors"]["StylizedFrames"] == 20.0


def test_no_point_of_the_front_is_beaten_and_every_other_is():
    points = combinations(MEASURED)
    front = [p.combination for p in pareto_front(points, MEASURED)]
    for point in points:
        beaten = any(
            o.seconds <= point.seconds and o.shortfall_db <= point.shortfall_db and o != point
            for o in points
        )
        assert beaten != (point in front)
    assert [p.seconds for p in front] == sorted(p.seconds for p in front)


def test_answers_are_the_least_of_those_that_qualify():
    points = combinations(MEASURED)
    fastest = fastest_within(points, 0.7)
    good = [p for p in points if p.shortfall_db <= 0.7]
    assert fastest.seconds == min(p.seconds for p in good)
    assert smallest_within(points, 2.0).model_bytes == min(
        p.model_bytes for p in points if p.shortfall_db <= 2.0
    )
    best = best_in(points, 300.0)
    assert best.shortfall_db == min(p.shortfall_db for p in points if p.seconds <= 300)
    with rejects("1 s"):
        best_in(points, 1.0)
    with rejects("-1 dB"):
        fastest_within(points, -1.0)


def test_repeats_of_a_measurement_tell_its_spread():
    repeats = [scene(field=t, psnr=q) for t, q in ((90.0, 25.0), (100.0, 25.1), (110.0, 24.9))]
    spread = spread_of([*repeats, style()])
    assert spread.seconds == {"RadianceField": pytest.approx(0.1)}
    assert spread.quality_db == {"scene": pytest.approx(0.1)}
    usual = combinations([*repeats, style()])[0]
    assert usual.seconds == pytest.approx(100 + 30 + 180 + 30)
    assert usual.seconds_spread == pytest.approx(10.0)
    assert combinations([scene(), style()])[0].seconds_spread is None


@pytest.mark.parametrize(
    ("psnr", "field", "overlaps"),
    [(26.0, 300.0, False), (26.0, 105.0, True), (25.05, 300.0, True)],
    ids=["another", "as slow", "as good"],
)
def test_points_that_noise_may_swap_are_marked(psnr, field, overlaps):
    repeats = [scene(field=t, psnr=q) for t, q in ((90.0, 24.9), (110.0, 25.1))]
    noisy = [style(network=t) for t in (100.0, 300.0)]  # which both points share
    measured = [*repeats, *noisy, scene("other", psnr, field)]
    front = pareto_front(combinations(measured), measured)
    assert [p.overlaps for p in front] == [overlaps] * 2


def test_without_repeats_nothing_is_said_of_the_spread():
    measured = [scene(), style(), scene("near", 25.2, 104.0)]
    assert [p.overlaps for p in pareto_front(combinations(measured), measured)] == [None] * 2


def test_an_appearance_is_as_large_as_its_field():
    by_name = {p.scene: p for p in combinations([scene(), style(), scene("small", size=25)])}
    assert by_name["small"].model_bytes == 25 + 4 + round(10 * 0.25)


def test_what_is_not_known_of_other_work_is_not_taken_for_none():
    unknown = replace(scene("old"), other_cpu_share=None)
    by_name = {p.scene: p for p in combinations([scene(), style(), unknown])}
    assert (by_name["old"].other_cpu_share, by_name[""].other_cpu_share) == (None, 0.0)


@pytest.mark.parametrize(
    "measured", [[scene(), style()], [scene(), style(), scene("slow", 24.0, 300.0)]]
)
def test_a_chart_of_one_shortfall_stays_in_its_frame(measured):
    points = combinations(measured)
    drawn = front_svg(points, pareto_front(points, measured))
    heights = re.findall(r' (?:cy|y1|y2|y)="([^"]+)"', drawn)
    assert heights
    for y in heights:
        assert 0 <= float(y) <= 420


def test_a_sweep_without_its_middle_is_refused():
    with rejects("trade-off", "quality"):
        combinations([scene("fast"), style()])


def test_of_two_settings_of_one_name_the_later_counts():
    one, two = {"A": {"x": 1, "y": 2}}, {"A": {"x": 3}, "B": {"z": 4}}
    assert merged(one, two) == {"A": {"x": 3, "y": 2}, "B": {"z": 4}}
    assert one == {"A": {"x": 1, "y": 2}}


def written(folder):
    points = combinations(MEASURED)
    content = TradeOffContent(
        "<b>place", "ink & wash", "draft", "ndc", "2 cores", "2026-01-01",
        "3 of 30 changes", points,
        pareto_front(points, MEASURED),
        [*MEASURED, replace(MEASURED[2], name="<i>", other_cpu_share=0.4)],
        lambda tuning, stylizer: f"luigi --stylizer '{stylizer}' --tuning '{tuning}'",
    )  # fmt: skip
    write_trade_off_page(folder / "page.html", content)
    return folder / "page.html"


def test_the_page_shows_every_point_and_escapes_all_text(tmp_path):
    points = combinations(MEASURED)
    page = written(tmp_path).read_text()
    assert page.count("<circle") == len(points)
    assert page.count('class="beaten"') == len(points) - len(pareto_front(points, MEASURED))
    assert "<b>place" not in page
    assert "<i>" not in page
    assert busy_words(0.4).strip(", ") in page
    assert not re.search(r'(?:src|href)="(?!#|data:)', page)
    assert all(question in page for question in QUESTIONS)
    assert written(tmp_path).read_text() == page


PROBE = """
  const description = document.querySelector(".description"), before = description.textContent;
  const gray = document.querySelector("circle.beaten");
  document.querySelector("circle.best").focus();
  const focused = description.textContent;
  gray.dispatchEvent(new PointerEvent("pointerenter"));
  return { before, focused, pointed: description.textContent, overflow: overflow() };
"""


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_a_browser_tells_what_a_point_is(tmp_path, width):
    answer = answer_of(written(tmp_path), PROBE, width)
    assert (answer["errors"], answer["overflow"]) == ([], 0)
    assert len({answer["before"], answer["focused"], answer["pointed"]}) == 3
    assert mentions(answer["focused"], "dB")
