"""The pages and summaries of a command: report content, gallery, grid summary, metric labels.

Begin with `report_content`.
"""
