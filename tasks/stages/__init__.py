"""The stages of the graph, each with its parameters, inputs and build, and their base classes.

Enters: parameters, and the folders of earlier stages. Leaves: one folder of the store for each
stage, which a step of `styletrf.steps` fills. Begin with `stage`; the stages are in `scene`,
`field`, `style`, `stylization` and `metrics`.
"""
