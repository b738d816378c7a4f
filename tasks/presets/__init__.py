"""The settings of stages: presets by name, and choices from a front of time and quality.

Enters: `--quality` or `--budget`, and measured fronts. Leaves: the values of the settings of each
stage. Begin with `presets`, the table of draft, standard and paper.
"""
