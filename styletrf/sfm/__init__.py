"""Structure from motion by COLMAP: where each photograph was taken from.

Enters: a capture. Leaves: undistorted photographs, pinhole cameras, sparse points, and `poses.json`
with the doubts about them. Begin with `camera_poses`; `mapping_choice` decides which pairs to match
and which mapper to believe, and `matching` matches them.
"""
