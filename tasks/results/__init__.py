"""The tasks that users request: a stylized trajectory, a grid, a scene report, a trade-off.

Enters: a scene, styles and options from the command line. Leaves: artifacts in the store with
links in `out/`: a report with videos, a viewer, exports. Begin with `trajectory`.
"""
