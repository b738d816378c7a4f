"""This machine: how fast it computes, and facts that it keeps in files beside its store.

No result depends on them. Begin with `calibration`.
"""
