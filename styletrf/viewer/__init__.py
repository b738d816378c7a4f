"""A viewer in one HTML file: walk around in a stylized place, and change its painting.

Enters: a density, appearances that share it, cameras. Leaves: `viewer.html`.
Begin with `baking` (values at lattice points) and `webpage/march.glsl`, which renders them as
`styletrf.field.kernels` do; `webpage.viewer_page` puts both into one file.
"""
