"""What a command would build, at what cost, and whether it can run at all.

Begin with `build_plan` (`--plan`) and `validation`.
"""
