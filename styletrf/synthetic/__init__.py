"""Scenes and paintings by the project's own code, exact and free of rights.

Enters: a configuration or a seed. Leaves: a ray-traced courtyard with true cameras and depth
(`courtyard`), and four style images (`paintings`). Begin with `courtyard`. No stage imports it.
"""
