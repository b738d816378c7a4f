"""The radiance field of TensoRF (Chen et al., ECCV 2022), and its rendering.

Enters: cameras, a space, and factors. Leaves: color, opacity and depth of rays.
Begin with `radiance_field`, `tensor_vm` (eq. 3-5) and `rendering`; rays are in `view_rays`.
`kernels` compute the hot loops, `training` fits a field to photographs.
"""
