"""The tasks that users request: a stylized trajectory, a grid, a scene report, a trade-off.

Begin with `trajectory`.
"""
