"""What steers a style changes the stages it is about, and what cannot be is refused in words."""

import math
import unicodedata

import pytest
from expected_errors import rejects
from stage_keys import WORDS, key_words

import tasks
from styletrf.errors import InputError

WHERE = {  # a control: the first stages that it changes
    "stroke_scale": (2.0, {"StyleNetwork", "StylizedField"}),  # whose losses look at the painting
    "content_weight": (0.5, {"StyleNetwork", "StylizedField"}),
    "colors": ("luminance", {"StylizedPriors", "StylizedField"}),  # without a loss of renders
    "strategy": ("s2", {"StylizedField", "StylizedFrames"}),  # which leave depths of their own
    "match": ("gram", {"StylizedField"}),
    "strength": (0.5, {"StylizedFrames"}),
    "blend": ({"udnie": 0.3}, {"StylizedFrames"}),
    "region": ({"box": [[0, 0, 0], [1, 1, 1]]}, {"StylizedFrames"}),
    "path": ("orbit", {"TrajectoryFrames"}),
    "seconds": (8.0, {"TrajectoryFrames"}),
    "frame_rate": (60, {"TrajectoryFrames"}),
    "frame_size": (3840, {"TrajectoryFrames"}),
}


@pytest.mark.parametrize("name", WHERE)
def test_a_control_changes_the_stages_it_is_about(name):
    value, stages = WHERE[name]
    before = key_words(tasks.StylizedTrajectory(content="embedded", **WORDS))
    after = key_words(tasks.StylizedTrajectory(content="embedded", **WORDS, **{name: value}))
    changed = {family for family in before if before[family] != after[family]}
    assert changed == stages | {"StylizedTrajectory"}


@pytest.mark.parametrize(
    ("words", "match"),
    [
        ({}, "distributions"),
        ({"quality": "standard"}, "distributions"),
        ({"quality": "paper"}, "pixels"),
        ({"strategy": "s1"}, "pixels"),
        ({"strategy": "s2"}, "pixels"),
        ({"colors": "photograph"}, "pixels"),
        ({"network": "mosaic.pth"}, "pixels"),
        ({"stylizer": "gatys"}, "distributions"),
        ({"colors": "luminance", "match": "gram"}, "gram"),
        ({"match": "pixels"}, "pixels"),
    ],
)
def test_renders_are_matched_where_the_painting_and_its_colors_are_wanted(words, match):
    stage = tasks.StylizedField(**{**WORDS, **words})
    assert stage.resolved_match == match
    assert ("transfer" in stage.requires()) == (match == "distributions")
    assert ("perceptual" in stage.requires()) == (match != "pixels")


def test_renders_that_nothing_sharpens_need_the_sharper_weights():
    nothing_after = {"settings": {"image.iterations": 0}}
    of_pixels = ({"match": "pixels"}, {"colors": "luminance"}, nothing_after)
    for words, least in (({}, None), *((words, 0.95) for words in of_pixels)):
        assert tasks.StylizedField(**WORDS, **words).values().get("weight_power.sharpness") == least
    given = {"weight_power.sharpness": 0.5}
    assert (
        tasks.StylizedField(match="pixels", settings=given, **WORDS).values().items()
        >= given.items()
    )


def families_above(task, seen=None) -> set[str]:
    seen = set() if seen is None else seen
    for stage in task.requires().values():
        seen.add(stage.task_family)
        families_above(stage, seen)
    return seen


def test_what_is_not_needed_is_not_made():
    cell = {"content": "embedded", **WORDS}
    gatys = families_above(tasks.StylizedTrajectory(stylizer="gatys", **cell))
    assert "ContentImages" not in gatys, "which starts from a network that needs no training"
    started = tasks.StylizedPriors(stylizer="gatys", settings={"start": "noise"}, **cell)
    assert "StyleNetwork" not in families_above(started)
    arbitrary = families_above(tasks.StyleNetwork(stylizer="arbitrary", **cell))
    assert arbitrary == {"StyleImage", "TransferWeights"}
    per_frame = families_above(tasks.StylizedTrajectory(method="per-frame", **cell))
    assert not {"StylizedField", "StylizedPriors", "PriorRenders"} & per_frame
    given = tasks.StyleNetwork(network="mosaic.pth", **cell)
    assert given.requires() == {}


def test_each_round_paints_what_the_one_before_left():
    third = tasks.StylizedField(rounds=3, content="embedded", **WORDS)
    painted = third.requires()["stylized"]
    assert painted.requires()["before"].rounds == 2
    first = painted.requires()["before"].requires()["stylized"].requires()["before"]
    assert first.rounds == 1
    assert "before" not in first.requires()["stylized"].requires()


def test_blended_styles_are_adapted_with_the_same_words():
    frames = tasks.StylizedFrames(blend={"udnie": 0.3}, colors="luminance", **WORDS)
    blended = frames.requires()["blend udnie"]
    assert (blended.style, blended.colors) == ("udnie", "luminance")
    assert frames.requires()["stylized"].style == "mosaic"
    given = tasks.StylizedFrames(blend={"udnie": 0.3}, network="mosaic.pth", **WORDS)
    assert given.requires()["stylized"].network == "mosaic.pth"
    assert given.requires()["blend udnie"].network == "", "which is the main style's"


def test_colors_of_a_given_network_are_kept_unless_an_option_decides_them():
    """Its painting is not known, so views were moved to the colors of another."""
    given = {"network": "mosaic.pth", **WORDS}
    frames = tasks.StylizedFrames(method="per-frame", **given)
    for stage in (tasks.StylizedPriors(**given), frames):
        assert "style" not in stage.requires()
        assert stage.requires()["network"].network == "mosaic.pth"
    for words in ({"colors": "photograph"}, {"colors": "luminance"}, {"stylizer": "gatys"}):
        assert "style" in tasks.StylizedPriors(**given, **words).requires()
    for words in ({}, {"stylizer": "arbitrary"}):
        assert "style" in tasks.StylizedPriors(**WORDS, **words).requires()
    assert "style" in tasks.StylizedFrames(method="per-frame", **WORDS).requires()


def test_factors_are_recorded_beside_the_settings_and_not_in_them():
    """The report's command repeats both: in the settings they would count twice."""
    stage = tasks.StyleNetwork(stroke_scale=2.0, content_weight=3.0, **WORDS)
    plain = tasks.StyleNetwork(**WORDS)
    assert stage.identity_parameters()["settings"] == plain.identity_parameters()["settings"]
    assert stage.identity_parameters() != plain.identity_parameters()


def test_free_strategies_are_fitted_as_the_field_is():
    stage = tasks.StylizedField(strategy="s1", settings={"fit.iterations": 7}, **WORDS)
    fit = tasks.RadianceField(scene="horns", quality="draft").values() | {"iterations": 7}
    assert {f"fit.{k}": v for k, v in fit.items()}.items() <= stage.values().items()
    assert not any(name.startswith("fit.") for name in tasks.StylizedField(**WORDS).values())


def test_one_network_is_not_for_several_styles():
    grid = tasks.Grid(scenes=["a"], styles=["x", "y"], network="x.pth")
    with rejects("--network x.pth"):
        grid.validate()


@pytest.mark.parametrize(
    "settings",
    [{"style_px": "big"}, {"temporal_loss.renders": "half"}, {"loss.content_weight": None}],
)
def test_a_setting_of_the_wrong_kind_does_not_break_the_graph(settings):
    tasks.StyleNetwork(settings=settings, stroke_scale=float("inf"), **WORDS).requires()


@pytest.mark.parametrize(
    ("family", "words", "subject"),
    [
        ("StylizedFrames", {"strength": 1.5}, "--strength 1.5"),
        ("StylizedFrames", {"strength": float("nan")}, "--strength nan"),
        ("StylizedFrames", {"blend": {"udnie": 1.0}}, "--blend"),
        ("StylizedFrames", {"blend": {"udnie": "much"}}, "--blend"),
        ("StylizedFrames", {"blend": {"a": 0.6, "b": 0.5}}, "--blend"),
        ("StylizedFrames", {"blend": {"a": 0.7, "b": 0.2, "c": 0.1}}, "--blend"),
        ("StylizedFrames", {"region": {"ball": 3}}, "--region"),
        ("StylizedFrames", {"region": {"box": [[0, 0, 0], [1, 1, 0]]}}, "--region"),
        ("StylizedFrames", {"region": {"box": 5}}, "--region"),
        ("StylizedFrames", {"region": {"box": [[-math.inf, 0, 0], [math.inf, 1, 1]]}}, "--region"),
        ("StylizedFrames", {"region": {"box": [["a", "b", "c"], ["d", "e", "f"]]}}, "--region"),
        ("StylizedFrames", {"region": {"view": "0001", "mask": "no.png"}}, "--region, mask no.png"),
        ("StylizedFrames", {"region": {"view": "0001", "mask": 5}}, "--region, mask 5"),
        ("StylizedFrames", {"region": {"view": "0001", "mask": __file__}}, __file__),
        ("StylizedFrames", {"region": {"view": 1, "mask": __file__}}, "--region {"),
        ("StylizedFrames", {"strategy": "s2", "strength": 0.5}, "--method field --strategy s2"),
        ("StylizedFrames", {"method": "per-frame", "blend": {"udnie": 0.3}}, "--method per-frame"),
        ("StylizedFrames", {"method": "per-frame", "colors": "luminance"}, "--method per-frame"),
        ("StylizedField", {"rounds": 0}, "--rounds 0"),
        ("StylizedField", {"strategy": "s1", "match": "gram"}, "--match gram --strategy s1"),
        ("StyleNetwork", {"stroke_scale": 0.0}, "--stroke-scale 0.0"),
        ("StyleNetwork", {"content_weight": float("inf")}, "--content-weight inf"),
        ("StyleNetwork", {"network": "no.pth"}, "--network no.pth"),
        ("StyleNetwork", {"network": __file__, "stroke_scale": 2.0}, "--network"),
        ("StyleNetwork", {"stylizer": "arbitrary", "content_weight": 2.0}, "--stylizer arbitrary"),
        (
            "StyleNetwork",
            {"settings": {"temporal_loss.renders": 0.5}},
            "setting 'temporal_loss.renders'",
        ),
        ("StylizedFrames", {"path": "orbits"}, "--path orbits"),
        ("TrajectoryFrames", {"path": ""}, "--path"),
        ("TrajectoryFrames", {"seconds": -1.0}, "--seconds -1.0"),
        ("PriorRenders", {"seconds": float("nan")}, "--seconds nan"),
        ("StyleMetrics", {"frame_rate": 20}, "--frame-rate 20"),
        ("StylizedField", {"frame_size": 4096}, "--frame-size 4096"),
        ("ConsistencyMetrics", {"frame_size": 16}, "--frame-size 16"),
    ],
)
def test_an_invalid_parameter_is_refused_by_its_name(family, words, subject):
    kind = getattr(tasks, family)
    own = {name: word for name, word in WORDS.items() if name in kind.get_param_names()}
    stage = kind(**own, **words)
    with pytest.raises(InputError) as error:
        stage.validate()
    assert error.value.subject.startswith(subject)
    assert error.value.problem
    assert error.value.remedy


def test_factors_steer_an_optimization_whatever_network_it_starts_from():
    """A network of the user's was said to rule them out."""
    words = {"stylizer": "gatys", "network": __file__, "stroke_scale": 2.0, "content_weight": 3.0}
    tasks.StyleNetwork(**WORDS, **words).validate()
    assert tasks.StylizedPriors(**WORDS, **words).identity_parameters()["factors"] == [2.0, 3.0]


def test_a_part_of_a_grid_is_whole_scenes():
    scenes = [f"s{k}" for k in range(5)]
    parts = [tasks.Grid(scenes=scenes, styles=["x", "y"], part=f"{k}/2") for k in (1, 2)]
    cells = [[(c.scene, c.style) for c in part.cells()] for part in parts]
    assert cells[0] + cells[1] == [(scene, style) for scene in scenes for style in ("x", "y")]
    assert len(cells[0]) == 4
    with rejects("--part 3/2", remedy=["2/5"]):
        tasks.Grid(scenes=scenes, styles=["x"], part="3/2").validate()


def test_a_path_is_known_to_those_alone_that_depend_on_it():
    """Poses, field, network and the quality of the field are the same tasks for every path."""
    for family in ("CameraPoses", "SceneModel", "RadianceField", "QualityMetrics", "StyleNetwork"):
        names = set(getattr(tasks, family).get_param_names())
        assert not names & {"path", "seconds", "frame_rate", "frame_size"}, family
    settings = {"temporal_loss.renders": 0.5}
    network = tasks.StyleNetwork(settings=settings, content="embedded", **WORDS)
    assert network.requires()["renders"].path == "auto"


def test_the_content_of_a_path_decides_and_not_its_name(tmp_path):
    files = [tmp_path / name for name in ("a.json", "b.json", "c.json")]
    for file, text in zip(files, ("[1]", "[1]", "[2]"), strict=True):
        file.write_text(text)
    first, same, other = (tasks.TrajectoryFrames(scene="s", path=str(file)) for file in files)
    assert first.identity_parameters() == same.identity_parameters() == other.identity_parameters()
    assert first.external_digests() == same.external_digests() != other.external_digests()
    named = tasks.TrajectoryFrames(scene="s", path="orbit")
    assert named.identity_parameters() != tasks.TrajectoryFrames(scene="s").identity_parameters()
    model = tmp_path / "model"
    model.mkdir()
    (model / "cameras.txt").write_text("1")
    before = tasks.TrajectoryFrames(scene="s", path=str(model)).external_digests()
    (model / "images.txt").write_text("1")
    assert tasks.TrajectoryFrames(scene="s", path=str(model)).external_digests() != before


@pytest.mark.parametrize(
    ("family", "settings", "named"),
    [
        ("QualityMetrics", {"lpips": True}, "LPIPS"),
        ("ConsistencyMetrics", {"method": "raft"}, "raft"),
    ],
)
def test_a_metric_without_its_weights_is_refused_before_anything_is_built(
    family, settings, named, tmp_path, monkeypatch
):
    """The command failed after all other stages."""
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    kind = getattr(tasks, family)
    own = {name: word for name, word in WORDS.items() if name in kind.get_param_names()}
    kind(**own).validate()
    with rejects(named):
        kind(settings=settings, **own).validate()


def test_names_with_accents_stored_apart_have_the_results_of_the_same_names_typed():
    names = [
        [unicodedata.normalize(f, n) for n in ("caf\xe9", "\xe9t\xe9")] for f in ("NFC", "NFD")
    ]
    assert names[0] != names[1]
    typed, stored = (tasks.StylizedTrajectory(scene=scene, style=style) for scene, style in names)
    assert (stored.task_id, stored.folder) == (typed.task_id, typed.folder)
    grids = [tasks.Grid(scenes=[scene], styles=[style]) for scene, style in names]
    assert grids[0].cells() == grids[1].cells() == [typed]
    blended = [typed.clone(blend={style: 0.5}) for _, style in names]
    assert blended[0] == blended[1] != typed
    both = [scene for scene, _ in names]
    with rejects("--scenes", "twice"):
        tasks.Grid(scenes=both, styles=["p"]).validate()
