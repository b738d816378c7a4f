"""This machine: its speed, and facts that it keeps in files beside its store.

No artifact depends on them. Begin with `calibration`.
"""
