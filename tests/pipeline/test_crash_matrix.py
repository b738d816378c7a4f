"""SIGKILL at every named point of publication and collection: nothing lost, nothing broken."""

import pytest
from crash_scenarios import COLLECTIONS, PUBLICATIONS, interruptions


@pytest.mark.parametrize(
    ("scenarios", "at_least"), [(PUBLICATIONS, 150), (COLLECTIONS, 120)], ids=["publish", "gc"]
)
def test_no_kill_loses_anything_or_leaves_anything_half_done(scenarios, at_least, tmp_path):
    assert interruptions("killed", scenarios, tmp_path) >= at_least


BAD_DISK = [
    *(each for each in PUBLICATIONS if each.name in ("fresh", "object flipped", "record garbage")),
    *(each for each in COLLECTIONS if each.name in ("shared", "shown")),
]


@pytest.mark.parametrize("scenario", BAD_DISK, ids=[each.name for each in BAD_DISK])
def test_a_disk_that_fails_at_any_write_is_survived(scenario, tmp_path):
    assert interruptions("faulted", [scenario], tmp_path) >= 4  # the least: one record is moved
