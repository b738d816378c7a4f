"""What photographs support of a frame: what three of them see, with nothing in between."""

from copy import deepcopy
from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch
from mini_scene import fitted_plane, painted_plane, photographs_of
from trajectory_captures import modeled

from styletrf.field.radiance_field import RadianceField
from styletrf.files.tables import read_summary
from styletrf.geometry.cameras import Camera, pixel_centers, points_at_depth, project
from styletrf.geometry.lenses import focal_from, focal_of
from styletrf.reports.coverage_text import support_summary
from styletrf.trajectory.support import (
    Support,
    SupportMeter,
    photographs_seeing,
    without_misses,
)
from styletrf.trajectory.support_config import SupportConfig
from styletrf.trajectory.supported_path import supported_fly_through, write_support
from styletrf.trajectory.trajectories import fly_through
from styletrf.trajectory.trajectory_config import TrajectoryConfig

CONFIG = SupportConfig()
WIDTH, HEIGHT = 32, 24


def camera(x: float = 0.0, turn_rad: float = 0.0) -> Camera:
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    rotation = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    pose = np.column_stack([rotation, [x, 0, 0]])
    return Camera("c", WIDTH, HEIGHT, 32.0, 32.0, 16.0, 12.0, pose)


def wall(distance: float = 4.0) -> np.ndarray:
    return np.full((HEIGHT, WIDTH), distance)


def seen(photographs, depths, depth=None) -> np.ndarray:
    depth = wall() if depth is None else depth
    counts = photographs_seeing(camera(), depth, photographs, depths, CONFIG)
    return counts.reshape(HEIGHT, WIDTH)


def test_photographs_from_the_same_place_see_all():
    assert (seen([camera()] * 3, [wall()] * 3) == 3).all()


@pytest.mark.parametrize("x", [-3.0, -1.0, 0.5, 2.0])
def test_a_photograph_beside_sees_what_lies_within_it(x):
    points = points_at_depth(camera(), pixel_centers(WIDTH, HEIGHT), wall().reshape(-1))
    column = project(camera(x), points)[0][:, 0].reshape(HEIGHT, WIDTH)
    inside = (column >= 0) & (column < WIDTH)
    np.testing.assert_array_equal(seen([camera(x)], [wall()]), inside.astype(int))


def test_what_stands_in_between_hides_the_wall():
    hidden = wall()
    hidden[:, : WIDTH // 2] = 2.0
    found = seen([camera(0.5)], [hidden])
    assert found.min() == 0
    assert 0.3 < found.mean() < 0.7


def test_a_surface_that_a_photograph_looks_through_is_not_seen_by_it():
    assert (seen([camera(0.5)], [wall(9.0)]) == 0).all()


def test_the_sky_is_seen_where_it_is_the_sky_there():
    sky = wall(np.inf)
    assert (seen([camera(0.5)], [sky], sky) == 1).all()
    assert (seen([camera(0.5)], [wall()], sky) == 0).all()
    assert (seen([camera(0.0, np.pi)], [sky], sky) == 0).all(), "and not behind"


def test_what_a_photograph_shows_and_the_field_lacks_is_not_seen_by_it():
    unknown = wall(np.inf)
    unknown[:, : WIDTH // 2] = 0.0
    for same_or_beside in (camera(), camera(0.01)):
        found = seen([same_or_beside], [unknown], wall(np.inf))
        assert (found[:, : WIDTH // 2 - 1] == 0).all()
        assert (found[:, WIDTH // 2 + 1 :] == 1).all()


WHITE = np.ones(3)


def disk() -> np.ndarray:
    """Returns the depth of a ball before nothing."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.where((x - 16) ** 2 + (y - 12) ** 2 < 64, 4.0, np.inf)


def photograph(*, around=None, mixed=False, masked=False) -> torch.Tensor:
    """Returns a photograph of the ball before white, or before the colors `around` it."""
    empty = ~np.isfinite(disk())
    image = np.where(empty[..., None], 255 if around is None else around, 60).astype(np.uint8)
    if mixed:  # its silhouette, a pixel wide
        silhouette = empty & (cv2.erode(empty.astype(np.uint8), np.ones((3, 3))) == 0)
        image[silhouette] = 150
    if masked:
        image = np.dstack([image, np.where(empty, 0, 255).astype(np.uint8)])
    return torch.from_numpy(image)


def grounds() -> np.ndarray:
    """Returns colors of a lawn, as a field that ends before it cannot show."""
    return np.random.default_rng(0).integers(0, 160, (HEIGHT, WIDTH, 3))


@pytest.mark.parametrize(
    "shown",
    [
        photograph(),
        photograph(mixed=True),
        photograph(around=np.full(3, 240)),
        photograph(around=grounds(), masked=True),
    ],
)
def test_background_that_photographs_show_as_such_is_no_miss(shown):
    np.testing.assert_array_equal(without_misses(disk(), shown, WHITE), disk())


def test_a_flat_border_where_photographs_show_something_is_unsupported():
    """The sky and the ground about a facade were one flat color, and counted as seen by all."""
    found = without_misses(disk(), photograph(around=grounds()), WHITE)
    empty = ~np.isfinite(disk())
    np.testing.assert_array_equal(found[~empty], disk()[~empty])
    assert (found[empty] == 0).all()
    counts = seen([camera(x) for x in (-0.1, 0.0, 0.1)], [found] * 3, disk())
    assert (counts[empty] == 0).all()
    assert (counts[~empty] >= 1).all()


def test_far_surfaces_that_no_parallax_tells_apart_are_the_same():
    assert (seen([camera(0.5)], [wall(3000.0)], wall(1000.0))[:, 1:] == 1).all()


@pytest.fixture(scope="module")
def field() -> RadianceField:
    return fitted_plane()


def meter_of(field: RadianceField, folder=None) -> SupportMeter:
    scene = painted_plane()
    cpu = torch.device("cpu")
    return SupportMeter(scene.cameras, field, scene.model.space, CONFIG, cpu, folder)


@pytest.fixture(scope="module")
def meter(field) -> SupportMeter:
    return meter_of(field)


def test_a_path_among_the_photographs_is_supported_and_one_that_looks_away_is_not(meter):
    scene = painted_plane()
    path = fly_through(scene.cameras, scene.model, TrajectoryConfig(frames=6))
    support = meter.measure(path)
    assert set(support.unsupported) == {camera.name for camera in path}
    away = [
        replace(c, world_from_camera=c.world_from_camera @ np.diag([-1.0, 1.0, -1.0, 1.0]))
        for c in path
    ]
    assert support.fraction < 0.2
    assert meter.measure(away).fraction == 1


def test_a_field_that_lacks_what_photographs_show_supports_no_path(field, tmp_path):
    """By its own depth alone, all photographs see what an empty field shows."""
    scene = painted_plane()
    folder = photographs_of(scene, tmp_path)[0].folder
    empty = deepcopy(field)
    empty.density.occupancy = torch.zeros_like(empty.density.occupancy)
    assert meter_of(empty).measure(scene.cameras).fraction < 0.1
    assert meter_of(empty, folder).measure(scene.cameras).fraction > 0.5
    as_is, compared = (meter_of(field, f).measure(scene.cameras) for f in (None, folder))
    assert compared == as_is, "where the field lacks nothing, colors are not looked at"


def test_worst_frames_come_first():
    assert Support({"a": 0.1, "b": 0.5, "c": 0.2}).worst(2) == ["b", "c"]


def spread_of(path) -> Support:
    """Counts as unsupported what a path uses of the space."""
    centers = np.stack([camera.center_world for camera in path])
    return Support({camera.name: float(np.ptp(centers[:, 0])) for camera in path})


def limits(most: float, stills: float = np.inf) -> SupportConfig:
    return replace(CONFIG, most_unsupported=most, least_for_stills=stills)


def test_the_default_path_is_narrowed_until_it_is_supported_and_no_further(tmp_path):
    views, model = modeled("forward")
    config = TrajectoryConfig(frames=12)
    whole = spread_of(fly_through(views, model, config)).fraction
    untouched = supported_fly_through(views, model, config, spread_of, limits(np.inf))
    assert [trial.spread for trial in untouched.trials] == [config.spread]
    narrowed = supported_fly_through(views, model, config, spread_of, limits(0.6 * whole))
    assert narrowed.support.fraction < 0.6 * whole
    assert narrowed.trials[-2].unsupported >= 0.6 * whole
    assert narrowed.trials[-1].unsupported == narrowed.support.fraction
    never = supported_fly_through(views, model, config, spread_of, limits(-1.0, stills=-1.0))
    assert never.support.fraction == min(trial.unsupported for trial in never.trials)
    assert {trial.spread for trial in never.trials if trial.zoom > 1} == {0.0}
    write_support(tmp_path / "support.json", "auto", narrowed, CONFIG)
    summary = read_summary(tmp_path / "support.json")
    assert summary["unsupported"] == narrowed.support.fraction
    assert [row["spread"] for row in summary["tried"]] == [t.spread for t in narrowed.trials]


def test_a_path_along_a_walk_which_no_spread_narrows_is_measured_once():
    """The same path was measured seven times."""
    views, model = modeled("walk")
    assert model.looking == "along"
    config = TrajectoryConfig(frames=4)
    found = supported_fly_through(views, model, config, spread_of, limits(-1.0))
    assert [trial.spread for trial in found.trials if trial.zoom == 1] == [config.spread]


def width_of(path) -> Support:
    """Counts as unsupported what a path sees at its margins, wherever it is."""
    return Support({camera.name: focal_of(camera) ** -4 for camera in path})


def gaps_everywhere(path) -> Support:
    """Counts as unsupported nearly as much of a narrower view."""
    return Support({camera.name: 1 / focal_of(camera) for camera in path})


def test_where_no_spread_is_enough_the_view_is_narrowed_unless_it_was_asked_for():
    views, model = modeled("forward")
    config = TrajectoryConfig(frames=4)
    whole = width_of(fly_through(views, model, config)).fraction
    narrowed = supported_fly_through(views, model, config, width_of, limits(0.3 * whole))
    assert narrowed.trials[-1].zoom == 1.5
    assert narrowed.trials[-1].spread == config.spread
    asked = supported_fly_through(
        views, model, replace(config, fov_deg=60.0), width_of, limits(0.1)
    )
    assert {trial.zoom for trial in asked.trials} == {1.0}
    assert focal_of(asked.cameras[0]) == pytest.approx(focal_from(60.0))


@pytest.mark.parametrize(("stills", "zoom"), [(0.2, 1.0), (0.05, 2.0)])
def test_a_narrower_view_that_is_not_enough_is_not_taken_unless_stills_were_due(stills, zoom):
    """Leaves hide what is behind them: 8 % of the pixels, a little less in narrower frames."""
    views, model = modeled("forward")
    config, whole = TrajectoryConfig(frames=4), focal_of(views[0])

    def hidden(path) -> Support:
        return Support({c.name: 0.04 + 0.04 * whole / focal_of(c) for c in path})

    found = supported_fly_through(views, model, config, hidden, limits(0.02, stills))
    assert focal_of(found.cameras[0]) == pytest.approx(zoom * whole)
    assert max(trial.zoom for trial in found.trials) == 2.0, "all were tried"
    assert {trial.spread for trial in found.trials if trial.zoom > 1} == {config.spread}


def test_a_narrower_view_that_shows_as_many_gaps_is_not_taken():
    views, model = modeled("forward")
    config = TrajectoryConfig(frames=4)
    whole = gaps_everywhere(fly_through(views, model, config)).fraction
    found = supported_fly_through(views, model, config, gaps_everywhere, limits(0.7 * whole))
    assert found.support.fraction == pytest.approx(whole)
    assert found.chosen == found.trials[0]
    assert min(trial.unsupported for trial in found.trials) < 0.7 * whole


@pytest.mark.parametrize(("tried_on", "zoom"), [(gaps_everywhere, None), (width_of, 1.5)])
def test_the_report_names_the_path_that_was_made_and_not_the_least_that_was_tried(
    tmp_path, tried_on, zoom
):
    views, model = modeled("forward")
    config = TrajectoryConfig(frames=4)
    whole = tried_on(fly_through(views, model, config)).fraction
    found = supported_fly_through(views, model, config, tried_on, limits(0.3 * whole))
    write_support(tmp_path / "support.json", "auto", found, CONFIG)
    text = support_summary(read_summary(tmp_path / "support.json"))
    assert ("narrowed" in text) == (zoom is not None)
    assert (f"focal length {zoom:g} times" if zoom else f"{whole:.1%}") in text


def test_a_narrower_spread_that_gains_little_is_not_taken():
    views, model = modeled("forward")
    config = TrajectoryConfig(frames=4)

    def hidden(path) -> Support:
        """A tenth, and a fifth of it more where the path is as wide as it can be."""
        width = spread_of(path).fraction / spread_of(fly_through(views, model, config)).fraction
        return Support({camera.name: 0.1 + 0.02 * width for camera in path})

    found = supported_fly_through(views, model, config, hidden, limits(0.02, 0.2))
    wide = fly_through(views, model, config)
    assert spread_of(found.cameras).fraction == pytest.approx(spread_of(wide).fraction)


def test_an_unsupported_path_is_warned_of_with_its_share_and_frames(tmp_path, caplog):
    views, model = modeled("forward")
    found = supported_fly_through(
        views, model, TrajectoryConfig(frames=4), spread_of, limits(np.inf)
    )
    poor = replace(found, support=Support({"0001": 0.1, "0002": 0.3}))
    write_support(tmp_path / "support.json", "orbit", poor, CONFIG)
    (record,) = caplog.records
    assert "20.0%" in record.message
    assert "0002, 0001" in record.message
    write_support(tmp_path / "support.json", "orbit", found, replace(CONFIG, most_unsupported=9.0))
    assert len(caplog.records) == 1
