"""Matches features of two photographs that are each other's nearest: exactly, and reproducibly.

COLMAP's own matcher on the CPU builds approximate indices in several threads at once, which
disturb each other: one matching in some hundred comes out different (pycolmap 4.2.1).
"""

from collections.abc import Sequence
from typing import no_type_check

import numpy as np
import torch
from jaxtyping import Float32, Int32, Int64
from numba import get_num_threads, prange

from styletrf.compiled import compiled
from styletrf.sfm.matching.sift_features import DESCRIPTOR_LENGTH, Descriptors

Matches = Int64[np.ndarray, "_ 2"]

MAX_RATIO = 0.8
MAX_ANGLE_RAD = 0.7
_NO_NANS = {"nnan", "nsz"}  # so that comparisons become vector instructions
_ROWS = 1024  # of similarities with one photograph: 16 MiB of them, with 4,096 features each
_MOST_TOGETHER = 8  # photographs whose descriptors make one matrix: as many as threads, from 2


def mutual_matches(first: Descriptors, others: Sequence[Descriptors]) -> list[Matches]:
    """Returns the matches of one photograph's features with those of each of the others.

    Two features match that are each other's most similar ones, at an angle of at most
    `MAX_ANGLE_RAD` and below `MAX_RATIO` of the angle to the second most similar one, both ways
    (Lowe 2004). Sums of products of bytes are integers below 2^24, which float32 holds exactly: no
    order of the additions, so no number of threads, changes them. (Bytes are exact in bfloat16 and
    TF32, too, so no lower precision of matrix products does.)

    Args:
        first: SIFT descriptors of the first, of length 512 but for rounding.
        others: Those of other photographs; any may have none.

    Returns:
        For each of the others, pairs of indices (of a feature of the first, of one of its own), in
        ascending order.
    """
    together = min(max(2, get_num_threads()), _MOST_TOGETHER)
    groups = [others[k : k + together] for k in range(0, len(others), together)]
    return [matches for group in groups for matches in _matches_of(first, group)]


def _matches_of(first: Descriptors, others: Sequence[Descriptors]) -> list[Matches]:
    ends = np.cumsum([0, *(len(other) for other in others)])
    of_first, of_others = _nearest(len(others), len(first)), _nearest(1, int(ends[-1]))
    if len(first) and ends[-1]:
        left = torch.from_numpy(first.astype(np.float32))
        right = torch.from_numpy(np.concatenate(others).astype(np.float32)).T
        rows = _ROWS // len(others)
        buffer = left.new_empty(rows, int(ends[-1]))
        for start in range(0, len(first), rows):
            block = left[start : start + rows]
            similarities = torch.mm(block, right, out=buffer[: len(block)])
            _keep_nearest(similarities.numpy(), start, ends, of_first, of_others)
    chosen, own = _distinct(of_first), _distinct(of_others)[0]
    return [_mutual(chosen[k], own[ends[k] : ends[k + 1]]) for k in range(len(others))]


_Nearest = tuple[
    Float32[np.ndarray, "parts features"],
    Float32[np.ndarray, "parts features"],
    Int32[np.ndarray, "parts features"],
]
"""For each feature in each part: the two highest similarities, and the index of the first."""


def _nearest(parts: int, features: int) -> _Nearest:
    shape = parts, features
    return np.full(shape, -1, np.float32), np.full(shape, -1, np.float32), np.zeros(shape, np.int32)


@compiled(parallel=True, fastmath=_NO_NANS)
@no_type_check
def _keep_nearest(similarities, start, ends, of_first, of_others):
    """Updates the nearest with similarities, whose rows begin at `start`; each part has columns."""
    for part in prange(len(ends) - 1):
        if ends[part] < ends[part + 1]:
            rows = similarities[:, ends[part] : ends[part + 1]]
            columns = slice(ends[part], ends[part + 1])
            best, second, whose = of_others
            _keep_columns(rows, start, best[0, columns], second[0, columns], whose[0, columns])
            best, second, whose = of_first
            _keep_rows(rows, start, best[part], second[part], whose[part])


@compiled(fastmath=_NO_NANS)
@no_type_check
def _keep_columns(rows, start, best, second, whose):
    for i in range(len(rows)):
        row, index = rows[i], np.int32(start + i)
        for j in range(len(row)):
            value, before = row[j], best[j]
            second[j] = max(second[j], min(value, before))
            whose[j] = index if value > before else whose[j]
            best[j] = max(before, value)


@compiled(fastmath=_NO_NANS)
@no_type_check
def _keep_rows(rows, start, best, second, whose):
    for i in range(len(rows)):
        row, top, after, where = rows[i], np.float32(-1), np.float32(-1), 0
        for value in row:
            top = max(top, value)
        while row[where] != top:
            where += 1
        for value in row[:where]:
            after = max(after, value)
        for value in row[where + 1 :]:
            after = max(after, value)
        best[start + i], second[start + i], whose[start + i] = top, after, where


def _distinct(nearest: _Nearest) -> Int32[np.ndarray, "parts features"]:
    """Returns whose feature is most similar; -1 where it is far, or the second nearly as near."""
    highest, second, whose = nearest
    angle, next_angle = (
        np.arccos(np.clip(x / DESCRIPTOR_LENGTH**2, 0, 1)) for x in (highest, second)
    )
    is_distinct = (angle <= MAX_ANGLE_RAD) & (angle < MAX_RATIO * next_angle)
    return np.where(is_distinct, whose, np.int32(-1))


def _mutual(of_first: Int32[np.ndarray, " n"], of_other: Int32[np.ndarray, " m"]) -> Matches:
    rows = np.flatnonzero(of_first >= 0)
    rows = rows[of_other[of_first[rows]] == rows]
    return np.stack([rows, of_first[rows].astype(np.int64)], axis=1)
