"""Exports of a scene for other programs: Gaussian splats, points, a mesh, cameras, Blender.

Enters: a density, appearances that share it, cameras. Leaves: files that published readers open.
Begin with `splat_placement` (where splats lie) and `splat_fit` (how opaque they are, and which
colors each style gives them); `splat_files` writes them.
"""
