"""The numerics of StyleTRF (Goel et al., ICVGIP 2022), as plain functions and small structs.

Photographs (`capture`) get cameras and sparse points (`sfm`) and the model that they require
(`scene`). A TensoRF (`field`) is fitted to them and rendered along a path (`trajectory`). A network
learns a painting (`style`) from photographs (`content`); the field's appearance takes the style of
a few stylized renders (`stylization`). `evaluation` measures the results and `reports` shows them.
All of these use `geometry` and `files`; `synthetic` makes test data.

Each package's docstring says what enters, what leaves, and where to begin. Importing this
package loads no torch. Conventions stand in `docs/conventions.md`, the order of the packages
in `docs/architecture.md`.
"""

__version__ = "0.1.0"
