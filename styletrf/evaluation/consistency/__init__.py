"""Measures the consistency of the frames of a trajectory.

In: frames with and without style, their cameras and depths. Out: a row for each pair of frames, and
their means. Begin with `trajectory_consistency.measure_consistency`: along the flow of the
unstylized frames as in the paper, along the field's depth, and as it looks.
"""
