"""Self-contained pages: of one fly-through, one scene, a grid, a trade-off.

Enters: results and their measures. Leaves: HTML with all its files inside.
Begin with `report`; the frame of every page is in `page`. The packages below hold the pages of a
grid, of a trade-off, and of the artifacts of a scene.
"""
