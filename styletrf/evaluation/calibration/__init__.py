"""How fast a machine computes: small workloads like those of the long stages, timed.

Enters: a device. Leaves: seconds of each workload. Begin with `workloads`.
"""
