"""Cameras, points and the maps between their coordinates.

Enters: poses, focal lengths and sparse points, as arrays or tables. Leaves: pinhole cameras,
projections, exact flow, and the projective maps from the world to a field's grid.
Begin with `cameras`, then `space`.
"""
