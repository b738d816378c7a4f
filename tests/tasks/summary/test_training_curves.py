"""What the report says of a fit that had other iterations than planned."""

from dataclasses import replace

import pytest

from tasks.summary.report_content import training_curve, with_note_of_its_end

ROWS = [{"iteration": 50 * k, "psnr": 20.0 + k} for k in range(1, 61)]


@pytest.mark.parametrize(
    ("planned", "differs"),
    [(2400, True), (2999, True), (3000, False), (3049, False), (3050, True), (5000, True)],
)
def test_another_end_than_planned_is_reported_and_the_planned_one_is_not(planned, differs):
    """A point every 50 iterations: a fit of 3,049 has its last at 3,000."""
    curve = training_curve("Field", "PSNR, dB", "psnr", ROWS)
    found = with_note_of_its_end(curve, planned)
    assert replace(found, note="") == curve
    assert bool(found.note) == differs
    assert (f"{planned:,}" in found.note) == differs


def test_notes_of_an_early_end_and_of_an_extended_fit_differ():
    curve = training_curve("Field", "PSNR, dB", "psnr", ROWS)
    early, extended = (with_note_of_its_end(curve, planned).note for planned in (5000, 2400))
    assert ("early" in early, "extended" in early) == (True, False)
    assert ("early" in extended, "extended" in extended) == (False, True)


@pytest.mark.parametrize("rows", [[], ROWS[:1]])
def test_a_curve_too_short_to_tell_stays_as_it_is(rows):
    curve = training_curve("Field", "PSNR, dB", "psnr", rows)
    assert with_note_of_its_end(curve, 5000) == curve


def test_a_curve_without_a_planned_end_stays_as_it_is():
    curve = training_curve("Field", "PSNR, dB", "psnr", ROWS)
    assert with_note_of_its_end(curve, 0) == curve
