"""Decides from the photographs which pairs to match and which mapper to believe."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path
from shutil import copyfile

from styletrf.capture.capture_file import Photograph
from styletrf.capture.photographs import FEWEST_PHOTOGRAPHS
from styletrf.colmap import pycolmap
from styletrf.progress import Progress
from styletrf.sfm.colmap_features import image_ids, read_descriptors, read_largest_descriptors
from styletrf.sfm.colmap_images import ColmapImages
from styletrf.sfm.colmap_mapping import (
    largest_first,
    map_globally,
    map_incrementally,
    match_again,
    match_pairs,
    pairs_within_other_pieces,
    panorama_pairs,
)
from styletrf.sfm.mapping import SfmResult, could_be_placed, explained_fraction, is_explained
from styletrf.sfm.mapping_ladder import ENOUGH_PLACED, MappingAttempt, best_mapping
from styletrf.sfm.matching.image_pairs import (
    Pairs,
    all_pairs,
    is_sequence,
    pairs_along,
    pairs_of,
    pairs_with,
    pairs_within,
    shots,
)
from styletrf.sfm.matching.preemptive_pairs import N_LARGEST, preemptive_pairs
from styletrf.sfm.matching.retrieval import similar_pairs
from styletrf.sfm.model_joining import joined
from styletrf.sfm.model_support import supported
from styletrf.sfm.own_lenses import give_own_lenses, shared_lenses_differ, with_own_lenses

STRONGER_UP_TO = 40  # photographs: stronger features take seconds each, and few need them
_EAGER = "incremental from a weaker start"
_LENSES = "a lens for each photograph"
_CLEARLY = 1.05  # times as much explained by a lens for each photograph: hardly more if not needed


@dataclass(frozen=True, slots=True)
class MappingTask:
    """Photographs to be mapped, whose features `database` holds.

    Attributes:
        database: The COLMAP database.
        images: The photographs as COLMAP has them.
        photographs: The same with what the capture knows of them, in the same order.
        exhaustive_up_to: Up to so many photographs, all pairs are matched.
        preemptive_up_to: Up to so many, each is matched with those that share the most matches of
            a few features with it; beyond, along a sequence where their names read like one, else
            with those that look most like it.
        neighbors: How many others each photograph is matched with.
        seed: Decides everything random.
        progress: Called for each phase.
        tracks: The global mapper looks at so many of an image only; None for all.
        describe_stronger: Fills another database with features that take longer, and match where
            the usual ones do not; None where there are none.
    """

    database: Path
    images: ColmapImages
    photographs: Sequence[Photograph]
    exhaustive_up_to: int
    preemptive_up_to: int
    neighbors: int
    seed: int
    progress: Progress
    tracks: int | None = None
    describe_stronger: Callable[[Path], None] | None = None


def reconstruct(task: MappingTask) -> SfmResult:
    """Returns the best mapping of a task's images, by the first way that explains enough.

    The global mapper goes first. Where it leaves photographs out, they are matched with all others,
    or, where they are many, with more than before; unless no pair at all was verified.
    Photographs whose shared lens is assumed have one each where they contradict it, and where fewer
    than 80 % are placed or explained. Where less than 80 % of the matches are explained, both
    mappers count the points that only two photographs share; where photographs are still left out,
    the incremental mapper is tried. Where then fewer than 80 % are placed or explained, it begins
    with less, verified pairs are matched again along their geometry, and at last all photographs
    are described by stronger features.
    """
    attempt = MappingAttempt
    rescue = partial(MappingAttempt, skip_if_placed=ENOUGH_PLACED)
    attempts = [
        attempt("the global mapper", partial(_first, task)),
        attempt("the global mapper, those left out matched with more,", partial(_left_out, task)),
        attempt(_LENSES, partial(_own_lenses, task, is_contradicted=True), inf, least_gain=1.0),
        rescue(_LENSES, partial(_own_lenses, task, is_contradicted=False), least_gain=_CLEARLY),
        attempt("the better mapper with points of two photographs", partial(_points_of_two, task)),
        attempt("the incremental mapper", partial(_incrementally, task)),
        rescue("the incremental mapper from a weaker start", partial(_eagerly, task)),
        rescue("guided matching", partial(_guided, task)),
        rescue("stronger features", partial(_stronger, task)),
    ]
    return best_mapping(attempts, len(task.photographs))


def _first(task: MappingTask, best: SfmResult | None) -> SfmResult:  # noqa: ARG001
    return _globally(task, *_pairs_to_match(task))


def _left_out(task: MappingTask, best: SfmResult | None) -> SfmResult | None:
    """Matches more pairs of the photographs left out, where pairs were chosen.

    These are all of their pairs where these are few, else twice as many as before: a capture of
    which most photographs are left out must not take a multiple of the time. Photographs that
    verified pairs connect form a piece, such as a burst. Of a piece that is not placed, pairs
    within it are left out: they do not connect it with others. Returns None where no two
    photographs that share the most matches show the same: others are assumed not to.
    """
    if best is None or best.matcher == "exhaustive":
        return None
    if best.matcher == "preemptive" and not best.verified_pairs:
        return None
    missing = _unplaced(best, task.images)
    if not missing:
        return None
    count = len(task.photographs)
    pairs, kind = pairs_with(count, missing), "all"
    if len(pairs) > task.neighbors * count:
        wider = replace(task, neighbors=2 * task.neighbors)
        apart = pairs_within_other_pieces(task.database, task.images, set(missing))
        pairs, kind = pairs_of(_pairs_to_match(wider, apart)[1], missing), "more"
    return _globally(task, f"{best.matcher}, then {kind} pairs of those left out", pairs)


def _points_of_two(task: MappingTask, best: SfmResult | None) -> SfmResult | None:
    """Counts points of two photographs, where those of three or more explain too little.

    Both mappers are tried, since the global one, fooled by a wallpaper, explains more in this way,
    too.
    """
    if best is None or is_explained(best) or not best.verified_pairs:
        return None
    return _better_of_two(task, best, "incremental")


def _own_lenses(
    task: MappingTask, best: SfmResult | None, *, is_contradicted: bool
) -> SfmResult | None:
    """Gives each photograph a lens of its own, here and later, where a shared one is only assumed.

    So photographs of several cameras are mapped whose files lost their EXIF, whether or not the
    placed ones contradict a shared lens. This attempt comes before points of two photographs count,
    since these hide a wrong lens: poses bend until they agree.
    """
    is_assumed = any(setting.assumed for setting in task.images.lenses)
    if best is None or not best.verified_pairs or not is_assumed or best.has_own_lenses:
        return None
    differ = bool(best.models) and shared_lenses_differ(best.models[0], task.images)
    if differ is not is_contradicted:
        return None
    return _mapped(task, replace(best, has_own_lenses=True), "global", fewest_views=3)


def _incrementally(task: MappingTask, best: SfmResult | None) -> SfmResult | None:
    """Maps incrementally, where enough is explained but photographs are left out."""
    if best is None or not is_explained(best):
        return None
    has_panoramas = bool(task.images.panoramas)  # whose views are placed by their common matches
    if not has_panoramas and not could_be_placed(task.database, best.models[0]):
        return None
    return _mapped(task, best, "incremental", fewest_views=3)


def _eagerly(task: MappingTask, best: SfmResult | None) -> SfmResult | None:
    if best is None or not best.verified_pairs:
        return None
    return _mapped(task, best, _EAGER, fewest_views=2)


def _guided(task: MappingTask, best: SfmResult | None) -> SfmResult | None:
    if best is None or not best.verified_pairs:
        return None
    match_again(task.database, task.images, task.seed, task.progress)
    matched = replace(best, matcher=f"{best.matcher}, guided")
    return _better_of_two(task, matched, _EAGER)


def _stronger(task: MappingTask, best: SfmResult | None) -> SfmResult | None:
    """Describes and matches the photographs once more, in a database of their own.

    Returns None where no two show the same, which would take minutes to find again, and where
    photographs are many, which would take a quarter of an hour.
    """
    if task.describe_stronger is None or best is None or not best.verified_pairs:
        return None
    if len(task.photographs) > STRONGER_UP_TO:
        return None
    database = task.database.with_stem(f"{task.database.stem}_stronger")
    task.describe_stronger(database)
    stronger = replace(task, database=database)
    first = _first(stronger, None)
    matcher = f"{first.matcher}, stronger features"
    matched = replace(first, matcher=matcher, has_own_lenses=best.has_own_lenses)
    return _better_of_two(stronger, matched, _EAGER) if first.verified_pairs else None


def _better_of_two(task: MappingTask, matched: SfmResult, other: str) -> SfmResult:
    """Returns the better mapping of the global and another mapper, points of two counted."""
    both = [_mapped(task, matched, mapper, fewest_views=2) for mapper in ("global", other)]
    return max(both, key=lambda mapping: mapping.quality)


def _globally(task: MappingTask, matcher: str, pairs: Pairs) -> SfmResult:
    verified = match_pairs(task.database, task.images, pairs, task.seed, task.progress)
    reason = "it placed all photographs and explains their matches"
    matched = SfmResult([], matcher, verified, "global", reason, 0.0)
    return _mapped(task, matched, "global", fewest_views=3) if verified else matched


def _mapped(task: MappingTask, matched: SfmResult, mapper: str, fewest_views: int) -> SfmResult:
    """Returns the models that a mapper finds; those that share photographs are joined."""
    if matched.has_own_lenses:
        task = _with_own_lenses(task)
    of = task.database, task.images, task.seed, task.progress
    if mapper == "global":
        models = map_globally(*of, fewest_views, task.tracks)
    else:
        models = map_incrementally(*of, fewest_views, eager=mapper == _EAGER)
    if fewest_views == 2:
        pieces = (supported(model) for model in models)
        models = largest_first(p for p in pieces if p.num_reg_frames() >= FEWEST_PHOTOGRAPHS)
    explained = explained_fraction(task.database, models)
    found = replace(matched, models=models, mapper=mapper, explained=explained)
    whole = joined(task.database, found, fewest_views, task.seed)
    return max(found, whole, key=lambda mapping: mapping.quality)


def _with_own_lenses(task: MappingTask) -> MappingTask:
    """Returns the task with a lens for each photograph, in a copy of its database."""
    database = task.database.with_stem(f"{task.database.stem}_own_lenses")
    copyfile(task.database, database)
    images = with_own_lenses(task.images)
    pairs = give_own_lenses(database, images)
    if pairs:
        match_pairs(database, images, pairs, task.seed, task.progress)
    return replace(task, database=database, images=images)


def _pairs_to_match(
    task: MappingTask, excluded: Sequence[tuple[int, int]] = ()
) -> tuple[str, Pairs]:
    """Returns how pairs were chosen, and the pairs without those that are excluded."""
    count, sequences = len(task.photographs), shots(task.photographs)
    if not sequences and count <= task.exhaustive_up_to:
        return "exhaustive", all_pairs(count)
    if not sequences and count <= task.preemptive_up_to:
        return "preemptive", _sharing(task, excluded)
    if not sequences and is_sequence([photograph.name for photograph in task.photographs]):
        sequences = [list(range(count))]
    near = [*pairs_within(sequences, 2 * task.neighbors), *panorama_pairs(task.images), *excluded]
    if not sequences:
        return "retrieval", _alike(task, 2 * task.neighbors, near)
    along, alike = pairs_along(sequences, task.neighbors), _alike(task, task.neighbors, near)
    return "sequential and retrieval", sorted({*along, *alike})


def _sharing(task: MappingTask, excluded: Sequence[tuple[int, int]]) -> Pairs:
    """Returns pairs whose largest features match, without those excluded or of one panorama."""
    with closing(pycolmap.Database.open(task.database)) as opened:
        ids = image_ids(opened, task.images)
        largest = [read_largest_descriptors(opened, number, N_LARGEST) for number in ids]
    left_out = [*panorama_pairs(task.images), *excluded]
    return preemptive_pairs(largest, task.neighbors, task.progress, left_out)


def _alike(task: MappingTask, neighbors: int, excluded: Pairs) -> Pairs:
    """Returns pairs that look alike by the features that the database holds."""
    with closing(pycolmap.Database.open(task.database)) as opened:
        ids = image_ids(opened, task.images)
        of = partial(read_descriptors, opened)
        return similar_pairs(len(ids), lambda k: of(ids[k]), neighbors, task.seed, excluded)


def _unplaced(mapping: SfmResult, images: ColmapImages) -> list[int]:
    """Returns the positions of the images that the largest model leaves out."""
    if not mapping.models:
        return list(range(len(images.files)))
    model = mapping.models[0]
    placed = {model.image(image_id).name for image_id in model.reg_image_ids()}
    return [index for index, file in enumerate(images.files) if file not in placed]
