"""Poses that a scene already has, beside its photographs.

Enters: LLFF's `poses_bounds.npy`, `transforms*.json` of Blender and instant-ngp, or a COLMAP
model. Leaves: `GivenPoses`. Begin with `given_poses`; `pose_formats` lists the readers.
"""
