"""What a command would build, in which order, at what cost, and whether it can run at all.

Begin with `build_plan` (`--plan`) and `validation`.
"""
