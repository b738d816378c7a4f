"""This machine: its speed, and facts that it keeps in files beside its store.

Enters: a device, or the user's files. Leaves: seconds of reference workloads, and digests of files
that need not be read again. No artifact depends on these facts. Begin with `calibration`.
"""
