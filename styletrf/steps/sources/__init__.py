"""The steps that read the user's input: photographs, content, a painting, published weights.

Enters: files and folders of the user. Leaves: checked copies, from which all other steps begin.
Begin with `scene_capture`.
"""
