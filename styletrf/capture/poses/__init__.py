"""Poses that a scene already has, beside its photographs.

Enters: LLFF's `poses_bounds.npy`, `transforms*.json` of Blender and instant-ngp, or a COLMAP
model. Leaves: `GivenPoses`. Begin with `pose_formats`, which chooses the reader; what all
readers return is in `given_poses`.
"""
