"""Scenes and paintings by the project's own code, exact and free of rights.

Leaves: a ray-traced courtyard with true cameras and depth (`courtyard`), and four style
images (`paintings`). No stage imports it.
"""
