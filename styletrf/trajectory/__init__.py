"""The path of the fly-through's camera, and the renders of a field along it.

Enters: the scene's cameras and model, a path's name or file, a field. Leaves: cameras of the
frames, float images with depth, pictures and a video. Begin with `chosen_path`, then `trajectories`
(paths) and `frames` (renders).
"""
