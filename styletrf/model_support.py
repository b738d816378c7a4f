"""Which photographs of a model hang together by points that three of them see.

A point that two photographs share tells how one lies to the other, but not how far: a model held
together by such points alone may be bent at will, and still explains all matches.
"""

import numpy as np
from jaxtyping import Bool

from styletrf.colmap import pycolmap

_FEWEST_POINTS = 15  # as many as COLMAP wants matches of a pair


def supported(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Returns the model without the photographs that `supported_images` leaves out."""
    images = supported_images(model)
    kept = pycolmap.Reconstruction(model)
    for image_id in sorted(set(model.reg_image_ids()) - images):
        kept.deregister_frame(kept.image(image_id).frame_id)
    return kept


def supported_images(model: pycolmap.Reconstruction) -> set[int]:
    """Returns the images that hang together: those resection would place one after the other.

    It begins with the two that share most points of three images or more; then comes whichever
    sees most points that two of those before see, at least 15.
    """
    ids = sorted(model.reg_image_ids())
    sees = _seen_by_three(model, ids)
    shared = np.triu(sees.T.astype(np.int64) @ sees, k=1)
    if shared.size == 0 or shared.max() < _FEWEST_POINTS:
        return set()
    placed = np.zeros(len(ids), dtype=bool)
    placed[list(np.unravel_index(int(shared.argmax()), shared.shape))] = True
    while not placed.all():
        known = sees[sees[:, placed].sum(axis=1) >= 2]
        counts = np.where(placed, 0, known.sum(axis=0))
        if counts.max() < _FEWEST_POINTS:
            break
        placed[int(counts.argmax())] = True
    return {image_id for image_id, is_placed in zip(ids, placed, strict=True) if is_placed}


def _seen_by_three(
    model: pycolmap.Reconstruction, ids: list[int]
) -> Bool[np.ndarray, "points images"]:
    """Returns which images see which of the points that at least three see."""
    column = {image_id: k for k, image_id in enumerate(ids)}
    points = model.points3D.values()
    sees = np.zeros((len(points), len(ids)), dtype=bool)
    for row, point in enumerate(points):
        sees[row, [column[element.image_id] for element in point.track.elements]] = True
    seen: Bool[np.ndarray, "points images"] = sees[sees.sum(axis=1) >= 3]
    return seen
