"""The page of a trade-off: its chart of quality over time, and tables of all measurements.

Enters: measurements, their combinations and the front. Leaves: HTML. Begin with `page`.
"""
