"""Measures how fast a machine computes, by small workloads like those of the long stages.

Enters: a device. Leaves: seconds of each workload. Begin with `workloads`.
"""
