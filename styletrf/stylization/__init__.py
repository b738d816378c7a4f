"""Makes a stylized field of a field and a style (StyleTRF sections 4.2, 4.3 and 5).

Enters: a field, a trajectory, a painter. Leaves: priors, their stylized versions, and
an appearance fitted to them, the density frozen.
Begin with `strategies`, then `priors` and `adaptation`.
"""
