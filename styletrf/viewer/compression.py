"""Bytes ordered by context and compressed by zlib, which browsers undo.

zlib gives each byte a code whose length follows from how often it occurs nearby. Values of one
context occur alike, so they stand together. A context is known before its value is: from a class,
or from values before.
"""

import zlib

import numpy as np
from jaxtyping import Int, Shaped, UInt8

from styletrf.viewer.lattice import SIDE


def packed_bytes(values: UInt8[np.ndarray, "..."]) -> bytes:
    """Returns the compressed bytes of an array in its order in memory.

    The shorter of two ways is taken: in noise, repetitions other than runs cost more than they
    save.
    """
    data = np.ascontiguousarray(values).tobytes()
    return min((_deflated(data, way) for way in (zlib.Z_RLE, zlib.Z_DEFAULT_STRATEGY)), key=len)


def _deflated(data: bytes, strategy: int) -> bytes:
    packing = zlib.compressobj(9, zlib.DEFLATED, zlib.MAX_WBITS, 9, strategy)
    return packing.compress(data) + packing.flush()


def in_contexts(
    values: Int[np.ndarray, "..."], contexts: Shaped[np.ndarray, "..."]
) -> Int[np.ndarray, " n"]:
    """Returns values in the order of their contexts; those of one context stay in their order."""
    return values.ravel()[np.argsort(contexts, axis=None, kind="stable")]


def before(values: Int[np.ndarray, "bricks 512"], axis: int) -> Int[np.ndarray, "bricks 512"]:
    """Returns the value before each point along an axis (0 is x), 0 where a brick begins."""
    cubes = values.reshape(-1, SIDE, SIDE, SIDE)
    shifted = np.zeros_like(cubes)
    to, of = ([slice(None)] * 4 for _ in range(2))
    to[3 - axis], of[3 - axis] = slice(1, None), slice(None, -1)
    shifted[tuple(to)] = cubes[tuple(of)]
    return shifted.reshape(values.shape)


def sum_before(values: Int[np.ndarray, "bricks 512"]) -> Int[np.ndarray, "bricks 512"]:
    """Returns the sum of the values before each point along x, y and z."""
    found: Int[np.ndarray, "bricks 512"]
    found = before(values, 0) + before(values, 1) + before(values, 2)
    return found


def wrapped(values: Int[np.ndarray, "..."]) -> UInt8[np.ndarray, "..."]:
    """Returns values modulo 256."""
    return (values & 255).astype(np.uint8)
