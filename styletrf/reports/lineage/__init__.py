"""The graph of a scene's artifacts: where each stands on the page, and the page.

Enters: artifacts with their inputs. Leaves: HTML with the graph and a table. Begin with `page`.
"""
