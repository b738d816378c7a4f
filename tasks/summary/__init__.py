"""The pages and summaries of a command: report content, gallery, grid summary, metric labels.

Enters: folders and records of the store. Leaves: what pages show, `out/index.html`, lineages, the
summary of a grid, and the request that its webhook gets. Begin with `report_content`.
"""
