"""Poses of photographs by comparing them with renders, for those that have none.

Enters: photographs, a field to render, cameras that are known. Leaves: cameras, and how
alike photograph and render are. Begin with `photograph_placement`; `image_alignment` moves
one camera.
"""
