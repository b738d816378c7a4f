"""Predicts which stages a command builds, at what cost, and whether it can run at all.

Enters: the task of a command, and the costs of earlier builds. Leaves: a plan with seconds and
memory of each stage, or the error that ends the command before its first stage.
Begin with `build_plan` (`--plan`) and `validation`.
"""
