"""What is told of a result's measures: each beside its floor, and what is not there as such."""

from tasks.measures import CONSISTENCY, QUALITY, RESEMBLANCE, metric_tables

ERRORS = {m.key: 0.002 for m in CONSISTENCY} | {m.other: 0.001 for m in CONSISTENCY if m.other}
SUMMARY = {
    "quality": {m.key: 20.0 for m in QUALITY},
    "resemblance": {m.key: 0.5 for m in RESEMBLANCE}
    | {m.other: 0.8 for m in RESEMBLANCE if m.other},
    "consistency": {"delta_5": {**ERRORS, "flow": "dis"}, "delta_1": {**ERRORS, "flow": "dis"}},
}


def told(summary) -> dict[str, list[tuple[str, str]]]:
    return {
        metric.name: [(figure.value, figure.beside) for figure in metric.figures]
        for table in metric_tables(summary)
        for metric in table.metrics
    }


def test_every_measure_is_told_once_beside_its_floor_short_term_first():
    assert len(told(SUMMARY)) == len(QUALITY) + len(RESEMBLANCE) + len(CONSISTENCY)
    between = metric_tables(SUMMARY)[2]
    assert list(between.columns) == ["short term", "long term"]
    for measure, metric in zip(CONSISTENCY, between.metrics, strict=True):
        assert all(bool(figure.beside) == bool(measure.other) for figure in metric.figures)
    assert told(SUMMARY)["error along the flow"] == [
        ("0.00200", "floor 0.00100, 2\N{NO-BREAK SPACE}times")
    ] * 2  # fmt: skip


def test_a_distance_to_the_painting_stands_beside_the_unstylised_frames():
    beside = "unstylised 0.80, 0.62\N{NO-BREAK SPACE}times"
    assert told(SUMMARY)["texture"] == [("0.50", beside)]


def test_what_has_no_value_is_not_measured():
    deltas = {"delta_1": {"error": None, "floor": 0.1}, "delta_5": {"error": 0.1, "floor": None}}
    lost = told({"quality": {"psnr": None}, "consistency": deltas})
    assert lost["PSNR"] == [("not measured", "")]
    assert lost["error along the flow"] == [
        ("not measured", ""),
        ("0.10000", "floor not measured"),
    ]


def test_what_was_not_asked_is_left_out_and_a_floor_of_nothing_divides_nothing():
    told_of_one = told({"quality": {}, "consistency": {"delta_2": {"error": 0.5, "floor": 0.0}}})
    assert told_of_one == {"error along the flow": [("0.50000", "floor 0.00000")]}
