"""Exports of a scene for other programs: Gaussian splats, points, a mesh, cameras, Blender.

Enters: a density, appearances that share it, cameras. Leaves: files that published readers open.
Begin with `splat_placement` (where splats begin) and `splat_fit` (gradient descent on all styles at
once, through `splat_pictures`); `splat_files` writes them.
"""
