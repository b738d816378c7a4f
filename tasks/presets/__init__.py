"""The settings of stages: presets by name, and choices from a front of time and quality.

Begin with `presets`, the table of draft, standard and paper.
"""
