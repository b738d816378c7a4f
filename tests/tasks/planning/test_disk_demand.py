"""Commands whose frames do not fit on the disk are refused before their first stage."""

from dataclasses import replace

import pytest
from expected_errors import rejects
from message_words import mentions

import tasks
from tasks.planning.disk_demand import BYTES_A_PIXEL, require_disk, written_bytes
from tasks.planning.memory_demand import Demand, Photographs
from tasks.planning.stage_demands import demand_of

SCENES = {"yard": Photographs(count=50, width=4000, height=3000)}
MINUTE_OF_4K = Demand("TrajectoryFrames", "yard", 504, 3840, 224**3, 60, 0, frames=1440)


@pytest.mark.parametrize("stage", BYTES_A_PIXEL)
def test_frames_take_space_in_proportion_to_their_number_and_pixels(stage):
    demand = replace(MINUTE_OF_4K, stage=stage)
    bytes_of_all = written_bytes(demand, SCENES["yard"])
    assert bytes_of_all == pytest.approx(BYTES_A_PIXEL[stage] * 1440 * 3840 * 2880)
    assert written_bytes(replace(demand, frames=720), SCENES["yard"]) * 2 == bytes_of_all
    assert written_bytes(replace(demand, frame_px=1920), SCENES["yard"]) * 4 == bytes_of_all


def test_the_frames_of_all_stages_have_to_fit_together():
    demands = [MINUTE_OF_4K, replace(MINUTE_OF_4K, stage="StylizedFrames")]
    needed = sum(written_bytes(demand, SCENES["yard"]) for demand in demands)
    require_disk(demands, int(needed) + 1, SCENES)
    free = int(needed / 2)
    sizes = [f"{size / 1e9:.1f} GB" for size in (needed, free)]
    with rejects(
        "yard", *sizes, remedy=["--frame-size", "STYLETRF_STORE", "--keep-going"]
    ) as error:
        require_disk(demands, free, SCENES)
    assert mentions(error.value.subject, "1440 frames", "11.1 megapixels")
    with rejects("yard"):
        require_disk(demands, int(needed) - 1, SCENES)


def test_the_frames_of_every_style_take_space():
    """The styles of a grid have equal demands, which counted once."""
    of_one = written_bytes(MINUTE_OF_4K, SCENES["yard"])
    require_disk([MINUTE_OF_4K], int(1.5 * of_one), SCENES)
    with rejects("yard", f"{2 * of_one / 1e9:.1f} GB"):
        require_disk([MINUTE_OF_4K, MINUTE_OF_4K], int(1.5 * of_one), SCENES)


def test_stages_without_frames_and_scenes_that_cannot_be_read_need_no_disk():
    require_disk([replace(MINUTE_OF_4K, stage="RadianceField")], 0, SCENES)
    require_disk([MINUTE_OF_4K], 0, {})


@pytest.mark.parametrize("strategy", ["s1", "s2"])
def test_frames_of_a_field_with_its_own_density_also_take_the_space_of_its_depths(strategy):
    def needed(family, **words):
        stage = getattr(tasks, family)(scene="yard", seconds=60.0, frame_size=3840, **words)
        return written_bytes(demand_of(stage), SCENES["yard"])

    pictures, own = (
        needed("StylizedFrames", style="p", strategy=each) for each in ("s3", strategy)
    )
    assert own == pytest.approx(pictures + needed("TrajectoryFrames"))
    painted = needed("StylizedFrames", style="p", strategy=strategy, method="per-frame")
    assert painted == pictures
