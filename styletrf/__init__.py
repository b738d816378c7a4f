"""The numerics of StyleTRF, as plain functions and small structs.

A scene is photographs (`photographs`), their cameras (`camera_poses`, `cameras`) and the model it
needs (`scene_model`). A radiance field (`field`, `field_training`) is fitted with the kernels in
`kernels`, rendered (`rendering`), painted by a style network (`style_network`, `style_training`) on
a few priors, and its appearance adapted to them (`adaptation`). `metrics` and `consistency`
measure.

Importing this package loads no torch. Conventions stand in `docs/conventions.md`.
"""

__version__ = "0.1.0"
