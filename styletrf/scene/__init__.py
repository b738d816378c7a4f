"""The model a scene requires, decided from its cameras and sparse points.

Enters: cameras and points of the world. Leaves: `SceneModel`: NDC, box or unbounded space,
resolution, plain or view-dependent color, exposures, each with its evidence.
Begin with `scene_model`.
"""
