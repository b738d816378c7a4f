"""A front of two points, and a fly-through of the mini scene that a request chooses from it."""

from styletrf.evaluation.trade_off import Combination
from tasks import StylizedTrajectory
from tasks.machine.calibration import keep_calibration, this_machine
from tasks.planning.stage_costs import reference_costs
from tasks.presets.quality_choice import Front

FAST = Combination(
    "quick", "", {"RadianceField": {"iterations": 9}}, 0.8, 24.0, -5.0, 100.0, 1.0, 0.0, 1, 1
)
GOOD = Combination("", "", {}, 0.0, 24.8, -5.0, 280.0, 1.0, 0.0, 1, 1)
FRONT = Front("the front of this scene (s)", "draft", (FAST, GOOD), None)


def as_there(_front, point):
    """The times of the machine that measured the front."""
    return point.seconds


def twice(front, point):
    return 2 * as_there(front, point)


def calibrated(times_slower: float) -> None:
    """This machine is so many times slower than that of the reference."""
    seconds = reference_costs().calibration.seconds
    slower = {kind: times_slower * value for kind, value in seconds.items()}
    keep_calibration(this_machine(), slower)


def mini(**words) -> StylizedTrajectory:
    return StylizedTrajectory(**{"scene": "mini", "style": "p", "content": "embedded"} | words)


def of_presets(**seconds: float):
    """The times of points of fronts of these qualities, whatever the point is."""
    return lambda front, _point: seconds[front.quality]
