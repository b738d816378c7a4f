"""The gallery of results: a tile for every result, and for each that is missing.

Enters: results with their files and measures. Leaves: one HTML page that links to them.
Begin with `page`; a result's part of it is in `tile`.
"""
