"""The stages of the graph, each with its parameters, inputs and build, and their base classes.

Begin with `stage`; the stages are in `scene`, `field`, `style`, `stylization` and `metrics`.
"""
