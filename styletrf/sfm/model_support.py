"""Finds the groups of photographs that are connected by points seen in at least three photographs.

A point in two photographs fixes their relative direction but not their scale. A model that only
such points connect can have many wrong shapes, and still explains all matches. The views of one
panorama, a frame of COLMAP's, count as one photograph.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool

from styletrf.colmap import pycolmap

_FEWEST_POINTS = 15  # as many as COLMAP wants matches of a pair


def supported(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Returns the model without the photographs that `supported_images` leaves out."""
    images = supported_images(model)
    kept = pycolmap.Reconstruction(model)
    left_out = set(model.reg_image_ids()) - images
    for frame_id in sorted({kept.image(image_id).frame_id for image_id in left_out}):
        kept.deregister_frame(frame_id)
    return kept


def supported_images(model: pycolmap.Reconstruction) -> set[int]:
    """Returns the connected images: those that resection would place one after the other.

    The first are the two that share most points of three images or more. Each next image sees most
    of the points that two images before it see, at least 15.
    """
    frame_of = {i: model.image(i).frame_id for i in model.reg_image_ids()}
    frames = sorted(set(frame_of.values()))
    columns = {image_id: frames.index(frame_id) for image_id, frame_id in frame_of.items()}
    sees = _seen_by_three(model, columns, len(frames))
    shared = np.triu(sees.T.astype(np.int64) @ sees, k=1)
    if shared.size == 0 or shared.max() < _FEWEST_POINTS:
        return set()
    placed = np.zeros(len(frames), dtype=bool)
    placed[list(np.unravel_index(int(shared.argmax()), shared.shape))] = True
    while not placed.all():
        known = sees[sees[:, placed].sum(axis=1) >= 2]
        counts = np.where(placed, 0, known.sum(axis=0))
        if counts.max() < _FEWEST_POINTS:
            break
        placed[int(counts.argmax())] = True
    return {image_id for image_id, column in columns.items() if placed[column]}


def _seen_by_three(
    model: pycolmap.Reconstruction, columns: Mapping[int, int], count: int
) -> Bool[np.ndarray, "points frames"]:
    """Returns which frames see which of the points that at least three see.

    Args:
        model: The reconstruction.
        columns: The positions of the images' frames.
        count: The number of frames.
    """
    points = model.points3D.values()
    sees = np.zeros((len(points), count), dtype=bool)
    for row, point in enumerate(points):
        sees[row, [columns[element.image_id] for element in point.track.elements]] = True
    seen: Bool[np.ndarray, "points frames"] = sees[sees.sum(axis=1) >= 3]
    return seen
