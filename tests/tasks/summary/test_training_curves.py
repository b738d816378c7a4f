"""What the report says of a fit that ended before its planned iterations."""

from dataclasses import replace

import pytest

from tasks.summary.report_content import training_curve, with_early_end

ROWS = [{"iteration": 50 * k, "psnr": 20.0 + k} for k in range(1, 61)]


@pytest.mark.parametrize(
    ("planned", "early"), [(3000, False), (3049, False), (3050, True), (5000, True)]
)
def test_an_early_end_is_reported_and_a_whole_fit_is_not(planned, early):
    """A point every 50 iterations: a fit of 3,049 has its last at 3,000."""
    curve = training_curve("Field", "PSNR, dB", "psnr", ROWS)
    found = with_early_end(curve, planned)
    assert replace(found, note="") == curve
    assert bool(found.note) == early
    assert (f"{planned:,}" in found.note) == early


@pytest.mark.parametrize("rows", [[], ROWS[:1]])
def test_a_curve_too_short_to_tell_stays_as_it_is(rows):
    curve = training_curve("Field", "PSNR, dB", "psnr", rows)
    assert with_early_end(curve, 5000) == curve
