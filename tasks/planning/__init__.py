"""Predicts which stages a command builds, at what cost, and whether it can run at all.

Begin with `build_plan` (`--plan`) and `validation`.
"""
