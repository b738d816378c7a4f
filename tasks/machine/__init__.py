"""This machine: how fast it computes, and facts that it keeps in files beside its store.

No artifact depends on them. Begin with `calibration`.
"""
